//! Another project's drivers on the model (`cargo chip drivers`).

use scarab_chip::drivers;

#[test]
#[ignore = "builds an image, which takes minutes the first time: cargo test -p scarab-chip --test drivers -- --ignored"]
fn every_row_agrees_or_states_why_not() {
    let rows = drivers::check(&drivers::build().expect("built")).expect("every step is reached");
    let differ: Vec<_> = rows.iter().filter(|row| !row.is_sound()).collect();
    assert!(rows.len() > 20 && differ.is_empty(), "{differ:#?}");
}
