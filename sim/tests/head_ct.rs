//! A real head: that of the file which the environment variable `DUALFRAME_CT` names.
#![cfg(feature = "image")]
#![forbid(unsafe_code)]

#[path = "head/checks.rs"]
mod checks;

use std::path::PathBuf;

use dualframe_sim::image::{Image, Thresholds};
use dualframe_sim::scene::head::Head;

#[test]
#[ignore = "needs DUALFRAME_CT, the path of a head's computed tomography"]
fn a_real_head() {
    let path = std::env::var_os("DUALFRAME_CT").map(PathBuf::from);
    let path = path.expect("DUALFRAME_CT names a file of computed tomography");
    let image = Image::open(&path).expect("the file is sound");
    let head = Head::from_ct(image, &Thresholds::default()).expect("it is a head");
    checks::check(&head);
    let voxels: u64 = head.skull.dims().iter().map(|&side| u64::from(side)).product();
    assert!(voxels < 60_000_000, "{:?}", head.skull.dims());
    let same = head.drilled(&head.skull, &[]).expect("it is the head's skull");
    assert!(&same == head.image(), "nothing was drilled");
}
