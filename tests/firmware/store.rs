//! Persistent data, tested on a flash with a power failure at any byte.

use std::cell::RefCell;
use std::rc::Rc;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use hal_sim::flash::{Flash, FlashError};
use scarab::leg::{
    AbsoluteAngle, Assured, Constant, CounterDirection, DriveState, ElectricalAngle, EncoderSetting, Fault,
    FaultCode, Fingerprint, JointZero, StoredCalibration, StoredModel, Stribeck,
};
use scarab::store::{
    CalibrationRecord, JointProvenance, Key, LoadError, ModelRecord, Permit, Provenance, RecordError,
    SaveError, Saved, Storage, Store, UnfitRange,
};
use scarab::units::{Celsius, Henry, Metre, NewtonMetre, NewtonMetrePerAmpere, Ohm};
use scarab_boot::Region;

use crate::testing::TestRandom;

/// Short sectors, so that the power can be cut at every byte of every operation.
const SECTOR: usize = 2048;
type Small = Flash<SECTOR, 2>;
/// Flash as on the board.
const BOARD_SECTOR: usize = Region::PARAMETERS.sector_bytes as usize;
type Board = Flash<BOARD_SECTOR, { Region::PARAMETERS.sectors as usize }>;

fn permit() -> Permit {
    Permit::from_state(DriveState::SwitchOnDisabled).expect("the drive is off")
}

fn calibration(number: u32) -> CalibrationRecord {
    CalibrationRecord(StoredCalibration {
        resistance: Ohm(0.05 + number as f32 * 1e-4),
        direct_inductance: Henry(2.5e-5),
        quadrature_inductance: Henry(3.1e-5),
        offset: ElectricalAngle::from_units(number.wrapping_mul(0x9E37_79B9).cast_signed()),
        encoder: EncoderSetting {
            counter: CounterDirection::Down,
            pole_pairs: 7,
            counts_per_turn: 8192,
            absolute: number % 2 == 1,
        },
        winding_c: (number % 2 == 1).then_some(number as f32 - 100.0),
        joint_zero: (number % 3 == 1).then_some(JointZero {
            rotor: -(number as i32),
            joint: AbsoluteAngle::from_steps(number as u16),
            setting: number as u8,
        }),
    })
}

fn model(number: u32) -> ModelRecord<2> {
    let value = |joint: usize, index: usize| number as f32 + joint as f32 * 0.5 - index as f32 * 0.125;
    ModelRecord {
        model: StoredModel {
            fingerprint: Fingerprint(0x0123_4567_89AB_CDEF ^ u64::from(number)),
            parameters: [0, 1].map(|joint| core::array::from_fn(|index| value(joint, index))),
            stribeck: [Stribeck { excess: 0.3, velocity: 0.05 }; 2],
            constant: [Constant::Offset, Constant::Asymmetry],
            assured: Assured {
                coulomb_nm: [0.25 * number as f32, 1.5],
                viscous: [0.125, 0.5 * number as f32],
                inertia_share: 1.0 / (number + 1) as f32,
            },
        },
        provenance: Provenance {
            firmware: [0, 1, 0],
            generation: number,
            swarm_seed: 0xFEDC_BA98_7654_3210,
            bridge: Some(Celsius(41.5)),
            worn: (!number.is_multiple_of(3)).then_some(false),
            joints: [0.44, 0.42].map(|length| JointProvenance {
                length: Metre(length),
                torque_per_ampere: NewtonMetrePerAmpere(3.2),
                rms: NewtonMetre(0.4),
                mean_absolute: NewtonMetre(11.9),
            }),
        },
    }
}

/// Model of the worn leg.
fn worn(number: u32) -> ModelRecord<2> {
    let mut worn = model(number);
    worn.provenance.worn = Some(true);
    worn
}

fn store<const BYTES: usize>(flash: Flash<BYTES, 2>) -> Store<Flash<BYTES, 2>> {
    Store::new(flash, 0..2 * BYTES as u32).expect("two sectors")
}

/// All data stored in a flash, as read by a firmware that has just started.
#[derive(Clone, Debug, PartialEq)]
struct Content {
    calibrations: [Option<CalibrationRecord>; 2],
    /// Models in the order of [`Key::MODELS`].
    models: [Option<ModelRecord<2>>; 2],
    objects: [Option<Vec<u8>>; 2],
}

const NOTHING: Content = Content { calibrations: [None; 2], models: [None; 2], objects: [None, None] };

fn content<const BYTES: usize>(flash: Flash<BYTES, 2>) -> Result<(Content, Flash<BYTES, 2>), LoadError> {
    let mut store = store(flash);
    let mut bytes = [0; 512];
    let calibrations = [block_on(store.load(Key::Calibration1))?, block_on(store.load(Key::Calibration2))?];
    let models = [block_on(store.load(Key::Model))?, block_on(store.load(Key::WornModel))?];
    let mut objects = [None, None];
    for (object, key) in objects.iter_mut().zip([Key::Objects1, Key::Objects2]) {
        *object = block_on(store.load_bytes(key, &mut bytes))?.map(|length| bytes[..length].to_vec());
    }
    Ok((Content { calibrations, models, objects }, store.into_flash()))
}

/// Kinds of changes.
const CHANGES: u32 = 6;

/// Stores the operator's `number`th change.
fn keep<const BYTES: usize>(store: &mut Store<Flash<BYTES, 2>>, number: u32) -> Result<Saved, SaveError> {
    let permit = permit();
    match number % CHANGES {
        0 => block_on(store.save(&permit, Key::Calibration1, &calibration(number))),
        1 => block_on(store.save(&permit, Key::Calibration2, &calibration(number))),
        2 | 3 => block_on(store.save(&permit, Key::Model, &model(number))),
        4 => block_on(store.save(&permit, Key::WornModel, &worn(number))),
        _ => block_on(store.save_bytes(
            &permit,
            Key::Objects1,
            &number.to_le_bytes().repeat(number as usize % 90 + 1),
        )),
    }
}

/// Stores the operator's `number`th change in a flash.
fn kept<const BYTES: usize>(
    flash: Flash<BYTES, 2>,
    number: u32,
) -> (Result<Saved, SaveError>, Flash<BYTES, 2>) {
    let mut store = store(flash);
    (keep(&mut store, number), store.into_flash())
}

#[test]
fn stored_data_is_present_after_a_start() {
    let mut first = store(Small::new(1));
    for number in 0..CHANGES {
        assert_eq!(keep(&mut first, number), Ok(Saved::Written), "{number}");
    }
    let (found, _) = content(first.into_flash()).unwrap();
    assert_eq!(found.calibrations, [Some(calibration(0)), Some(calibration(1))]);
    assert_eq!(found.models, [Some(model(3)), Some(worn(4))]);
    assert_eq!(found.objects, [Some(5_u32.to_le_bytes().repeat(6)), None]);
}

#[test]
fn writing_needs_a_drive_that_is_off() {
    use DriveState::{
        FaultReactionActive, NotReadyToSwitchOn, OperationEnabled, QuickStopActive, ReadyToSwitchOn,
        SwitchOnDisabled, SwitchedOn,
    };
    let (fault, remaining_ticks) = (Fault { code: FaultCode::Overspeed, joint: 0 }, 1);
    let off = DriveState::Fault { fault };
    for state in [NotReadyToSwitchOn, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, off] {
        assert!(Permit::from_state(state).is_some(), "{state:?}");
    }
    let damps = [QuickStopActive { remaining_ticks }, FaultReactionActive { fault, remaining_ticks }];
    for state in [OperationEnabled].into_iter().chain(damps) {
        assert!(Permit::from_state(state).is_none(), "{state:?}");
    }
}

/// Every operation of a history that uses both sectors twice, cut at every byte that it programs or erases.
#[test]
fn a_power_cut_at_any_byte_leaves_the_old_or_the_new() {
    let mut flash = Small::new(7);
    let mut cuts = 0_u32;
    let mut torn = [0_u32; 2];
    for number in 0..40 {
        let (before, clean) = content(flash.clone()).unwrap();
        let (saved, done) = kept(clean.clone(), number);
        let (after, _) = content(done.clone()).unwrap();
        assert_eq!(saved, Ok(Saved::Written));
        assert_ne!(before, after, "{number}: nothing was written");
        for cut in 1..=done.worked() - clean.worked() {
            let mut dying = clean.clone();
            dying.fail_after(Some(cut));
            let (saved, mut dead) = kept(dying, number);
            assert!(dead.is_dead() && saved == Err(SaveError::Flash), "{number}, byte {cut}: {saved:?}");
            dead.fail_after(None);
            let (found, next) =
                content(dead).unwrap_or_else(|error| panic!("{number}, byte {cut}: {error:?}"));
            let new = found == after;
            assert!(new || found == before, "{number}, byte {cut}: neither old nor new:\n{found:?}");
            torn[usize::from(new)] += 1;
            // Data stored afterwards is stored correctly.
            let [last, expected] = [next, if new { done.clone() } else { clean.clone() }].map(|flash| {
                let (saved, flash) = kept(flash, number + 1);
                saved.unwrap_or_else(|error| panic!("{number}, byte {cut}: {error:?}"));
                content(flash).unwrap().0
            });
            assert_eq!(last, expected, "{number}, byte {cut}: after the cut");
            cuts += 1;
        }
        flash = done;
    }
    println!("{cuts} cuts: {} left the old, {} the new; erasures {:?}", torn[0], torn[1], flash.erasures());
    assert!(flash.erasures().iter().all(|erased| *erased >= 1), "{:?}", flash.erasures());
}

/// A second cut during the repair after the first one.
#[test]
fn a_power_cut_during_a_repair_leaves_the_old_or_the_new() {
    let mut flash = Small::new(11);
    let mut random = TestRandom::new(1);
    for number in 0..400 {
        let (before, clean) = content(flash).unwrap();
        let (saved, done) = kept(clean.clone(), number);
        saved.unwrap();
        let (after, _) = content(done.clone()).unwrap();
        let mut dying = clean.clone();
        dying.fail_after(Some(1 + random.below((done.worked() - clean.worked()).max(1))));
        let (_, mut dead) = kept(dying, number);
        // Cuts the power twice more, within the work of a repair: a sector erased and records copied.
        for _ in 0..2 {
            dead.fail_after(Some(1 + random.below(3 * SECTOR as u64)));
            dead = kept(dead, number).1;
        }
        dead.fail_after(None);
        let (found, next) = content(dead).unwrap_or_else(|error| panic!("{number}: {error:?}"));
        assert!(found == before || found == after, "{number}: {found:?}");
        flash = next;
    }
}

/// Corrupt, foreign, older or newer data: refused by name or read correctly, never a mixture, never a panic.
#[test]
fn corrupt_flash_gives_stored_data_or_an_error() {
    let mut kept = store(Small::new(3));
    for number in 0..CHANGES {
        keep(&mut kept, number).unwrap();
    }
    let flash = kept.into_flash();
    let (whole, _) = content(flash.clone()).unwrap();
    let (mut whole_count, mut partly, mut refused) = (0, 0, 0);
    for bit in 0..8 * 1200 {
        let mut corrupt = flash.clone();
        corrupt.bytes_mut()[bit / 8] ^= 1 << (bit % 8);
        match content(corrupt) {
            Ok((found, _)) if found == whole => whole_count += 1,
            Ok((found, _)) => {
                // Remaining data equals data that was stored once.
                assert!(found.calibrations[0].is_none() || found.calibrations[0] == whole.calibrations[0]);
                assert!(found.calibrations[1].is_none() || found.calibrations[1] == whole.calibrations[1]);
                let [unworn, of_worn] = found.models;
                assert!(unworn.is_none() || unworn == Some(model(2)) || unworn == whole.models[0]);
                assert!(of_worn.is_none() || of_worn == whole.models[1]);
                assert!(found.objects[0].is_none() || found.objects[0] == whole.objects[0]);
                partly += 1;
            }
            Err(_) => refused += 1,
        }
    }
    println!("one bit of 9600 flipped: {whole_count} read whole, {partly} in part, {refused} refused");
    let mut random = TestRandom::new(5);
    for _ in 0..300 {
        let mut foreign = Small::new(1);
        foreign.bytes_mut().fill_with(|| random.byte());
        if let Ok((found, _)) = content(foreign) {
            assert_eq!(found, NOTHING);
        }
    }
}

#[test]
fn a_foreign_flash_is_usable_after_an_erase() {
    let mut foreign = Small::new(1);
    foreign.bytes_mut().fill(0x5A);
    let mut store = store(foreign);
    block_on(store.forget_all(&permit())).unwrap();
    assert_eq!(keep(&mut store, 0), Ok(Saved::Written));
    assert_eq!(block_on(store.load(Key::Calibration1)), Ok(Some(calibration(0))));
}

#[test]
fn implausible_records_are_neither_stored_nor_read() {
    let mut store = store(Small::new(1));
    let mut wrong = calibration(1);
    wrong.0.resistance = Ohm(f32::NAN);
    let refused = block_on(store.save(&permit(), Key::Calibration1, &wrong));
    assert_eq!(refused, Err(SaveError::Record(RecordError::Range)));
    // A record of another kind under this key, and one of a later firmware.
    block_on(store.save_bytes(&permit(), Key::Calibration1, &[1, 0, 3])).unwrap();
    let found = block_on(store.load::<CalibrationRecord>(Key::Calibration1));
    assert_eq!(found, Err(LoadError::Record(RecordError::Length)));
    block_on(store.save_bytes(&permit(), Key::Calibration1, &[9, 0, 3])).unwrap();
    let found = block_on(store.load::<CalibrationRecord>(Key::Calibration1));
    assert_eq!(found, Err(LoadError::Record(RecordError::Newer { schema: 9 })));
    assert_eq!(block_on(store.save_bytes(&permit(), Key::Objects1, &[0; 500])), Err(SaveError::TooLong));
}

/// Record of schema 1, which had no confidence bounds.
fn first_schema(record: &ModelRecord<2>) -> Vec<u8> {
    let ModelRecord { model, provenance } = record;
    let mut bytes = vec![1, 0];
    bytes.extend(model.fingerprint.0.to_le_bytes());
    bytes.extend(provenance.firmware);
    bytes.extend(provenance.generation.to_le_bytes());
    bytes.extend(provenance.swarm_seed.to_le_bytes());
    bytes.extend(provenance.bridge.expect("known").0.to_le_bytes());
    bytes.push(provenance.worn.map_or(2, u8::from));
    for (joint, from) in provenance.joints.iter().enumerate() {
        let curve = model.stribeck[joint];
        bytes.extend(model.parameters[joint].iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend([curve.excess, curve.velocity].iter().flat_map(|value| value.to_le_bytes()));
        bytes.push(u8::from(model.constant[joint] == Constant::Asymmetry));
        let numbers = [from.length.0, from.torque_per_ampere.0, from.rms.0, from.mean_absolute.0];
        bytes.extend(numbers.iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

#[test]
fn a_model_of_schema_1_has_no_confidence_bounds() {
    let mut store = store(Small::new(1));
    for number in [7, 9] {
        let bytes = first_schema(&model(number));
        assert_eq!(bytes.len(), 2 + 190);
        block_on(store.save_bytes(&permit(), Key::Model, &bytes)).unwrap();
        let mut expected = model(number);
        assert_ne!(expected.model.assured, Assured::NOTHING);
        expected.model.assured = Assured::NOTHING;
        assert_eq!(block_on(store.load(Key::Model)), Ok(Some(expected)));
    }
    // Stored again, the record has schema 2 and its bounds.
    block_on(store.save(&permit(), Key::Model, &model(7))).unwrap();
    let mut bytes = [0; 512];
    let length = block_on(store.load_bytes(Key::Model, &mut bytes)).unwrap().expect("stored");
    assert_eq!((length, &bytes[2..192]), (2 + 210, &first_schema(&model(7))[2..]));
    assert_eq!((&bytes[..2], &bytes[192..196]), (&[2, 0][..], &1.75_f32.to_le_bytes()[..]));
    assert_eq!(block_on(store.load(Key::Model)), Ok(Some(model(7))));
}

#[test]
fn ranges_too_small_for_a_store_are_refused() {
    for range in [0..SECTOR as u32, 0..3 * SECTOR as u32, 4..2 * SECTOR as u32 + 4, 2 * SECTOR as u32..0] {
        assert_eq!(Store::new(Small::new(1), range.clone()).err(), Some(UnfitRange), "{range:?}");
    }
    assert_eq!(Store::new(Flash::<256, 2>::new(1), 0..512).err(), Some(UnfitRange));
}

#[test]
fn a_flash_without_power_gives_a_flash_error() {
    let mut dead = Small::new(1);
    dead.fail_after(Some(0));
    let mut store = store(dead);
    assert_eq!(block_on(store.load::<ModelRecord<2>>(Key::Model)), Err(LoadError::Flash));
    assert_eq!(keep(&mut store, 0), Err(SaveError::Flash));
    let _: FlashError = FlashError::NoPower;
}

#[test]
fn a_thousand_models_need_few_erasures() {
    few_erasures(1_000, 8);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn ten_thousand_models_need_few_erasures() {
    few_erasures(10_000, 75);
}

/// Stores accepted models on the board's sectors.
fn few_erasures(models: u32, most: u32) {
    let mut store = store(*Box::new(Board::new(1)));
    for number in 0..models {
        assert_eq!(block_on(store.save(&permit(), Key::Model, &model(number))), Ok(Saved::Written));
    }
    let flash = store.into_flash();
    let erased: u64 = flash.erasures().iter().map(|&erased| u64::from(erased)).sum();
    let worked = flash.worked() - erased * BOARD_SECTOR as u64;
    let each = flash.erasures();
    println!(
        "{models} models: {worked} bytes programmed, erasures {each:?} of 10,000 permitted for a sector"
    );
    // A record with its log's header has 224 bytes: some 72 in a sector.
    assert!(flash.erasures().iter().all(|&erased| erased <= most), "{:?}", flash.erasures());
}

fn storage(flash: Small) -> Storage<Small, 2> {
    Storage::new(store(flash))
}

/// Calibrations, generations of the models, bytes of the first node, and the flash with them.
type Found = ([Option<StoredCalibration>; 2], [Option<u32>; 2], Vec<u8>, Small);

/// Data that a start finds.
fn found(flash: Small) -> Found {
    let mut storage = storage(flash);
    let calibrations = [0, 1].map(|axis| block_on(storage.calibration(axis)));
    let models = Key::MODELS.map(|key| block_on(storage.model(key)).expect("readable"));
    let generation = models.map(|model| model.map(|model| model.provenance.generation));
    let mut bytes = [0; 64];
    let length = block_on(storage.objects(0, &mut bytes)).expect("readable");
    (calibrations, generation, bytes[..length].to_vec(), storage.into_flash())
}

#[test]
fn a_save_stores_objects_calibrations_and_the_model() {
    let stored = [1, 2].map(|number| calibration(number).0);
    let mut first = storage(Small::new(1));
    // Only one axis passed: its calibration waits for the other's.
    first.calibrated(0, Some(stored[0]));
    assert_eq!(block_on(first.save(&permit(), [b"hip", b"knee"], 4)), Some(4));
    let (calibrations, generation, objects, flash) = found(first.into_flash());
    assert_eq!((calibrations, generation, &objects[..]), ([None; 2], [None; 2], &b"hip"[..]));

    let mut second = storage(flash);
    stored.iter().enumerate().for_each(|(axis, stored)| second.calibrated(axis, Some(*stored)));
    second.accept(model(9));
    assert_eq!(block_on(second.save(&permit(), [b"HIP", b"knee"], 4)), Some(5));
    // Nothing changed, so nothing new is stored.
    assert_eq!(block_on(second.save(&permit(), [b"HIP", b"knee"], 5)), Some(5));
    let (calibrations, generation, objects, _) = found(second.into_flash());
    assert_eq!((calibrations, generation, &objects[..]), (stored.map(Some), [Some(5), None], &b"HIP"[..]));
}

#[test]
fn models_of_the_empty_and_the_worn_leg_are_stored_side_by_side() {
    let save = |storage: &mut Storage<Small, 2>, before: u32| {
        block_on(storage.save(&permit(), [b"hip", b"knee"], before))
    };
    let mut first = storage(Small::new(1));
    for accepted in [worn(8), model(7), worn(9)] {
        first.accept(accepted);
    }
    assert_eq!(save(&mut first, 4), Some(6));
    assert_eq!(save(&mut first, 6), Some(6), "nothing is pending");
    let stored = Key::MODELS.map(|key| block_on(first.model(key)).expect("readable"));
    let at = |mut model: ModelRecord<2>, generation| {
        model.provenance.generation = generation;
        Some(model)
    };
    assert_eq!(stored, [at(model(7), 5), at(worn(9), 6)]);

    // A newer model replaces that of its key only; one of unknown leg replaces the empty leg's.
    first.accept(worn(10));
    assert_eq!(save(&mut first, 6), Some(7));
    let (_, generations, _, flash) = found(first.into_flash());
    assert_eq!(generations, [Some(5), Some(7)]);
    let mut second = storage(flash);
    assert_eq!(model(12).provenance.worn, None);
    second.accept(model(12));
    assert_eq!(save(&mut second, 7), Some(8));
    assert_eq!(found(second.into_flash()).1, [Some(8), Some(7)]);
}

/// Flash whose power the test switches while a storage uses it.
#[derive(Clone)]
struct Shared(Rc<RefCell<Small>>);

impl ErrorType for Shared {
    type Error = FlashError;
}

impl ReadNorFlash for Shared {
    const READ_SIZE: usize = Small::READ_SIZE;

    async fn read(&mut self, offset: u32, into: &mut [u8]) -> Result<(), FlashError> {
        block_on(self.0.borrow_mut().read(offset, into))
    }

    fn capacity(&self) -> usize {
        self.0.borrow().capacity()
    }
}

impl NorFlash for Shared {
    const WRITE_SIZE: usize = Small::WRITE_SIZE;
    const ERASE_SIZE: usize = Small::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        block_on(self.0.borrow_mut().erase(from, to))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        block_on(self.0.borrow_mut().write(offset, bytes))
    }
}

#[test]
fn a_failed_save_of_both_models_is_completed_by_the_next() {
    let save = |cut: Option<u64>| {
        let flash = Shared(Rc::new(RefCell::new(Small::new(1))));
        let mut storage = Storage::new(Store::new(flash.clone(), 0..2 * SECTOR as u32).expect("two sectors"));
        storage.accept(model(1));
        storage.accept(worn(2));
        flash.0.borrow_mut().fail_after(cut);
        let first = block_on(storage.save(&permit(), [b"hip", b"knee"], 4));
        flash.0.borrow_mut().fail_after(None);
        let second = block_on(storage.save(&permit(), [b"hip", b"knee"], first.unwrap_or(4)));
        drop(storage);
        let flash = flash.0.borrow().clone();
        let work = flash.worked();
        (first, second, content(flash).unwrap().0, work)
    };
    let (first, second, expected, work) = save(None);
    assert_eq!((first, second), (Some(6), Some(6)));
    let generation = |model: &Option<ModelRecord<2>>| model.map(|model| model.provenance.generation);
    assert_eq!(expected.models.each_ref().map(generation), [Some(5), Some(6)]);
    for cut in 1..=work {
        let (first, second, found, _) = save(Some(cut));
        assert_eq!((first, second), (None, Some(6)), "byte {cut}");
        assert_eq!(found, expected, "byte {cut}");
    }
}

#[test]
fn erased_data_is_not_stored_again_by_the_next_save() {
    let mut storage = storage(Small::new(1));
    let find = |storage: &mut Storage<Small, 2>| {
        (0..2).for_each(|axis| storage.calibrated(axis, Some(calibration(axis as u32).0)));
        storage.accept(model(3));
        storage.accept(worn(3));
    };
    find(&mut storage);
    assert_eq!(block_on(storage.save(&permit(), [b"hip", b"knee"], 0)), Some(2));
    find(&mut storage);
    assert_eq!(block_on(storage.forget(&permit())), Some(0));
    assert_eq!(block_on(storage.save(&permit(), [b"new", b"new"], 0)), Some(0));
    let (calibrations, generation, objects, _) = found(storage.into_flash());
    assert_eq!((calibrations, generation, &objects[..]), ([None; 2], [None; 2], &b"new"[..]));
}

#[test]
fn a_failed_write_is_reported_and_stores_nothing() {
    let mut flash = Small::new(1);
    flash.fail_after(Some(0));
    let mut storage = storage(flash);
    storage.accept(model(3));
    assert_eq!(block_on(storage.forget(&permit())), None);
    assert_eq!(block_on(storage.save(&permit(), [b"hip", b"knee"], 7)), None);
    let mut flash = storage.into_flash();
    flash.fail_after(None);
    let mut storage = self::storage(flash);
    storage.accept(model(3));
    assert_eq!(block_on(storage.save(&permit(), [b"hip", b"knee"], 7)), Some(8));
}
