//! NIfTI-1, packed or not, and whatever is neither.
#![no_main]

use dualframe_sim::image::Image;
use libfuzzer_sys::{Corpus, fuzz_target};

fuzz_target!(|file: &[u8]| -> Corpus {
    if file.starts_with(b"NRRD") {
        return Corpus::Reject;
    }
    let _ = Image::read(file, file.len() as u64);
    Corpus::Keep
});
