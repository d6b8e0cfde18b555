#![allow(missing_docs, clippy::all)]
use nalgebra::Vector3;
use scarab::ident::*;
use scarab::model::*;
const B: usize = 13;
type R = Recorder<f32, 2, B, 1024, 103>;
fn load(p: &str) -> Vec<Vec<f64>> {
    std::fs::read_to_string(p)
        .unwrap()
        .lines()
        .skip(1)
        .map(|l| l.split(',').map(|x| x.parse().unwrap()).collect())
        .collect()
}
fn main() {
    let bw: f32 = std::env::args().nth(1).map(|s| s.parse().unwrap()).unwrap_or(8.0);
    let link = |a| DenavitHartenberg { alpha: 0.0, a, d: 0.0 };
    let chain = Chain::new(&[link(0.0f32), link(0.45)]).unwrap();
    let gravity = Vector3::new(9.81f32, 0.0, 0.0);
    let base = BaseParameters::<f32, 2, B>::analyse(&chain, &gravity, &[[true; 14]; 2]).unwrap();
    let model = RowModel { chain, gravity, base };
    let d = load("/work/shared/data/mujoco_leg/fourier_nominal_flex.csv");
    let c = load("/work/shared/data/mujoco_leg/fourier_nominal_clean_100Hz.csv");
    let n = d.len() / 2;
    // 500 Hz: mean of pairs
    let s: Vec<[f64; 5]> = (0..n - 1)
        .map(|i| {
            let mut o = [0.0; 5];
            for k in 0..5 {
                o[k] = (0.5 * d[2 * i][k] + d[2 * i + 1][k] + 0.5 * d[2 * i + 2][k]) / 2.0;
            }
            o
        })
        .collect();
    let mut rec = R::new(bw).unwrap();
    let mut val = R::new(bw).unwrap();
    let mut instants = vec![];
    for (i, x) in s.iter().enumerate() {
        let q = [x[1] as f32, -x[2] as f32];
        let t = [x[3] as f32, -x[4] as f32];
        if x[0] < 20.0 {
            rec.push(&model, &q, &t);
        }
        if let Some(p) = val.push(&model, &q, &t) {
            if i >= 10000 {
                instants.push((x[0] - val.kernel().reach() as f64 * 0.002, p.instant));
            }
        }
        if i == 9999 {
            val.clear();
        }
    }
    let record = rec.record();
    // clean torque through the same chain
    let mut cl = R::new(bw).unwrap();
    let mut ms = R::new(bw).unwrap();
    let mut pairs = vec![];
    for (i, x) in s.iter().enumerate() {
        if x[0] < 19.0 {
            continue;
        }
        let q = [x[1] as f32, -x[2] as f32];
        let u = x[0] * 100.0;
        let k = (u.floor() as usize).min(c.len() - 2);
        let f = u - k as f64;
        let t = [7, 8].map(|m| (c[k][m] * (1.0 - f) + c[k + 1][m] * f) as f32);
        let a = cl.push(&model, &q, &t);
        let b = ms.push(&model, &q, &[x[3] as f32, -x[4] as f32]);
        if let (Some(a), Some(b)) = (a, b) {
            if let (Some(a), Some(b)) = (a.rows, b.rows) {
                if x[0] > 20.5 {
                    pairs.push((a, b));
                }
            }
        }
        let _ = i;
    }
    let p = Problem::new(&record, &model);
    for plan in [Plan::OneTime] {
        let e = p.least_squares(plan);
        println!("noise {:?} cond {:?} rows {:?}", p.noise(), p.whole().condition(), record.rows);
        let truth: LegParameters<f32, 2> = [
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.506224, 1.7, 0.102, 0.0, 8.5, 0.12, 3.0, 1.2, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.2546, 0.864, -0.072, 0.0, 4.8, 0.08, 2.0, 0.8, 0.0],
        ];
        let tb = model.base.project(&truth);
        for b in 0..13 {
            let (j, pa) = model.base.independent(b).unwrap();
            println!(
                "{}{} {:.5} truth {:.5} sigma {:.5}  {:+.2}",
                pa.symbol(),
                j + 1,
                e.values[b],
                tb[b],
                e.sigma(b).unwrap(),
                (e.values[b] - tb[b]) / e.sigma(b).unwrap()
            );
        }
        let vr = val.record();
        for j in 0..2 {
            let er = vr.torque_error(j, &e.values).unwrap();
            println!(
                "val joint {} rms {:.4} pct mean abs {:.3}  train {:.3}",
                j,
                er,
                100.0 * er / vr.torque[j].mean_absolute,
                100. * record.torque_error(j, &e.values).unwrap() / record.torque[j].mean_absolute
            );
        }
        for limit in [0.05f32, 1.0] {
            for j in 0..2 {
                let (mut e1, mut e2, mut m, mut n, mut nn) = (0.0, 0.0, 0.0, 0.0, 0.0);
                for (a, b) in &pairs {
                    if a.still[j] > limit {
                        continue;
                    }
                    n += 1.0;
                    let pr: f32 = a.regressor[j].iter().zip(&e.values).map(|(x, y)| x * y).sum();
                    e1 += (pr - a.torque[j]).powi(2);
                    e2 += (pr - b.torque[j]).powi(2);
                    m += a.torque[j].abs();
                    nn += (a.torque[j] - b.torque[j]).powi(2);
                }
                println!(
                    "filtered, still<={limit} joint {j}: clean {:.3} % recording {:.3} % noise alone {:.3} % rows {}",
                    100.0 * (e1 / n as f32).sqrt() / (m / n as f32),
                    100.0 * (e2 / n as f32).sqrt() / (m / n as f32),
                    100.0 * (nn / n as f32).sqrt() / (m / n as f32),
                    n
                );
            }
        }
        // clean torque comparision pointwise (all rows, incl. those near reversal)
        let mut acc = [0.0f64; 2];
        let mut accf = [0.0f64; 2];
        let mut m = [0.0f64; 2];
        let mut cnt = 0;
        let mut cntf = [0; 2];
        for (t, s) in &instants {
            let k = (t * 100.0).round();
            if (t * 100.0 - k).abs() > 0.11 {
                continue;
            }
            let Some(cl) = c.get(k as usize) else { continue };
            let rows = model.rows(s);
            cnt += 1;
            for j in 0..2 {
                let pr: f32 = rows.regressor[j].iter().zip(&e.values).map(|(a, b)| a * b).sum();
                let er = f64::from(pr) - cl[7 + j];
                acc[j] += er * er;
                m[j] += cl[7 + j].abs();
                if cl[3 + j].abs() > 0.02 {
                    accf[j] += er * er;
                    cntf[j] += 1;
                }
            }
        }
        for j in 0..2 {
            println!(
                "vs clean joint {} : {:.3} % of mean abs (all {}), moving {:.3} % ({})",
                j,
                100.0 * (acc[j] / cnt as f64).sqrt() / (m[j] / cnt as f64),
                cnt,
                100.0 * (accf[j] / cntf[j] as f64).sqrt() / (m[j] / cnt as f64),
                cntf[j]
            );
        }
    }
}
