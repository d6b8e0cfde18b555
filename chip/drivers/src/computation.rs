//! Integer and floating-point computation that gives the same words on every machine.
//!
//! The host computes the words too, so an error shared by both emulators would be detected. Products and sums
//! are not fused, and results that are not finite count as one word: both may differ between machines.

/// Operands: ordinary, huge, tiny, subnormal and special.
const FLOATS: [f32; 12] = [
    0.0,
    -0.0,
    1.0,
    -1.5,
    core::f32::consts::PI,
    1.0e-39,
    -3.0e-45,
    3.4e38,
    -1.0e20,
    16_777_217.0,
    f32::INFINITY,
    0.1,
];

fn mix(sum: u32, word: u32) -> u32 {
    (sum ^ word).wrapping_mul(0x0100_0193).rotate_left(7)
}

fn bits(value: f32) -> u32 {
    if value.is_nan() { 0x7FC0_0000 } else { value.to_bits() }
}

/// Checksum over sums, differences, products, quotients, comparisons and conversions.
pub fn floats() -> u32 {
    let mut sum = 1;
    for a in FLOATS.map(core::hint::black_box) {
        for b in FLOATS.map(core::hint::black_box) {
            for value in [a + b, a - b, a * b, a / b] {
                sum = mix(sum, bits(value));
                sum = mix(sum, value as i32 as u32);
                sum = mix(sum, value as u32);
            }
            sum = mix(sum, u32::from(a < b) | u32::from(a >= b) << 1 | u32::from(a == b) << 2);
            sum = mix(sum, bits((f64::from(a) / 3.0 + f64::from(b)) as f32));
        }
        sum = mix(sum, bits(sum as f32));
        sum = mix(sum, bits(sum as i32 as f32));
    }
    sum
}

/// Checksum over arithmetic of 32 and 64 bits, divisions, shifts and counts.
pub fn integers() -> u32 {
    let (mut sum, mut state) = (1, 0x9E37_79B9_7F4A_7C15_u64);
    for step in 0..200_u32 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (a, b) = (core::hint::black_box((state >> 32) as u32), core::hint::black_box(state as u32));
        let words = [
            a.wrapping_add(b).wrapping_sub(step),
            a / (b >> (step % 32)).max(1),
            (a as i32).wrapping_div((b as i32 >> (step % 29)) | 1) as u32,
            (a as i32).wrapping_rem((b as i32 >> (step % 29)) | 1) as u32,
            ((u64::from(a) * u64::from(b)) >> 32) as u32,
            ((i64::from(a as i32) * i64::from(b as i32)) >> (step % 64)) as u32,
            (state / (u64::from(b) | 1)) as u32,
            (a as i32).saturating_add(b as i32) as u32,
            (a as i16).saturating_sub(b as i16) as u32,
            a.leading_zeros() | a.trailing_zeros() << 8 | b.count_ones() << 16,
            a.reverse_bits() ^ b.swap_bytes(),
            a.checked_shl(b & 63).unwrap_or(step),
            (a as i32 >> (b & 31)) as u32,
            u32::from(a.overflowing_add(b).1) | u32::from((a as i32).overflowing_mul(b as i32).1) << 1,
        ];
        sum = words.into_iter().fold(sum, mix);
    }
    sum
}
