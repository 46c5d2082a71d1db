//! Where there is no memory.

use std::hint::black_box;
use std::process::Command;

use dualframe_sim::image::ImageError;
use dualframe_sim::scene::head::HeadError;

use crate::HEAD;

/// What is neither taken nor counted.
const LEAST: usize = 1 << 16;

/// Takes all memory that is to be had, but `room` bytes in one piece and what is in pieces of less than [`LEAST`].
fn take_all_but(room: usize) -> Vec<Vec<u8>> {
    let left = black_box(Vec::<u8>::with_capacity(room));
    let mut taken = Vec::with_capacity(1_024);
    let mut size = 1 << 30;
    while size >= LEAST {
        let mut piece = Vec::new();
        match piece.try_reserve_exact(size) {
            Ok(()) => taken.push(piece),
            Err(_) => size /= 2,
        }
    }
    drop(left);
    taken
}

/// Run by [`no_memory_to_drill_in_is_an_error`].
#[test]
#[ignore = "run by another test, within limits"]
fn drills_without_memory() {
    let head = &*HEAD;
    let product = |sides: [u32; 3]| sides.iter().map(|&side| side as usize).product::<usize>();
    let voxels = size_of_val(head.image().voxels());
    let blocks = product(head.image().grid().dims().map(|side| side.div_ceil(2)));
    let skull = product(head.skull.dims());
    for (room, missing) in [(0, voxels), (voxels + LEAST, blocks), (voxels + blocks + LEAST, skull)]
    {
        let taken = take_all_but(room);
        let drilled = head.drilled(&head.skull, &[]).map(drop);
        drop(taken);
        let error = drilled.expect_err("there is no memory");
        let HeadError::Image(ImageError::Memory { bytes }) = error else { panic!("{error}") };
        assert_eq!(bytes, missing as u64);
    }
    assert_eq!(&head.drilled(&head.skull, &[]).expect("there is memory"), head.image());
}

#[test]
fn no_memory_to_drill_in_is_an_error() {
    let test = std::env::current_exe().expect("this one");
    // 4 GiB.
    let script = "ulimit -v 4194304; exec \"$0\" --ignored --exact memory::drills_without_memory";
    let child = Command::new("sh")
        .args(["-c".as_ref(), script.as_ref(), test.as_os_str()])
        // Each thread sets 64 MiB aside.
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .expect("there is a shell");
    let said = [child.stdout, child.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
    assert!(child.status.success() && said[0].contains("1 passed"), "{said:?}");
}
