//! What is saved is whole, or what was there is.

use dualframe_sim::image::{Grid, Image, save};
use glam::{DAffine3, DVec3};

use crate::files::Nifti;
use crate::round_trips::read;

#[test]
fn saved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let image = read(&Nifti::small().bytes());
    for name in ["volume.nii", "volume.nii.gz"] {
        let path = folder.path().join(name);
        // Left there by a process of this number that was killed.
        let left = folder.path().join(format!("{name}.{}.0.part", std::process::id()));
        std::fs::write(&left, "half").expect("the folder takes it");
        save(&path, image.grid(), image.voxels()).expect("the folder takes it");
        assert_eq!(Image::open(&path).expect("it was just written"), image, "{name}");
        let packed = std::fs::read(&path).expect("it was just written").starts_with(&[0x1f, 0x8b]);
        assert_eq!(packed, name.ends_with(".gz"), "{name}");
    }
    // None longer can stand beside it.
    let path = folder.path().join("v".repeat(251) + ".nii");
    save(&path, image.grid(), image.voxels()).expect("the folder takes it");
    assert_eq!(Image::open(&path).expect("it was just written"), image);
}

/// Where no file may be longer than a few kilobytes, as on a full disk, the image that was there stays; run by
/// [`a_full_disk_keeps_what_was_there`].
#[cfg(unix)]
#[test]
#[ignore = "run by another test, within limits"]
fn saves_on_a_full_disk() {
    let path = std::env::var_os("DUALFRAME_TEST_IMAGE").expect("the other test says where");
    let grid = Grid::new([64; 3], DAffine3::from_scale(DVec3::splat(1e-3))).expect("allowed");
    let voxels = vec![0_u8; grid.voxels()];
    let error = save(path.as_ref(), &grid, &voxels).expect_err("there is no room for it");
    assert!(error.to_string().contains("too large"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_full_disk_keeps_what_was_there() {
    use std::fs;
    use std::os::unix::fs::{PermissionsExt, symlink};

    let folder = tempfile::tempdir().expect("a temporary folder");
    let (path, link) = (folder.path().join("volume.nii"), folder.path().join("link.nii"));
    let image = read(&Nifti::small().bytes());
    save(&path, image.grid(), image.voxels()).expect("the folder takes it");
    symlink("volume.nii", &link).expect("the folder takes it");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("it is ours");
    let test = std::env::current_exe().expect("this one");
    let script = "trap '' XFSZ; ulimit -f 8; exec \"$0\" --ignored --exact saves::saves_on_a_full_disk";
    let child = std::process::Command::new("sh")
        .args(["-c".as_ref(), script.as_ref(), test.as_os_str()])
        .env("DUALFRAME_TEST_IMAGE", &link)
        .output()
        .expect("there is a shell");
    let said = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && said.contains("1 passed"), "{said}");
    assert_eq!(Image::open(&path).expect("it is whole"), image);
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2, "something is left");

    let changed = vec![7_i16; image.voxels().len()];
    save(&link, image.grid(), &changed).expect("there is room");
    assert_eq!(Image::open(&path).expect("it is whole").voxels(), changed);
    assert!(fs::symlink_metadata(&link).expect("it is there").is_symlink());
    let mode = fs::metadata(&path).expect("it is there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600, "others may read it");
    if std::path::Path::new("/dev/full").exists() {
        save("/dev/full".as_ref(), image.grid(), &changed).expect_err("it is full");
    }
}

#[cfg(unix)]
#[test]
fn a_link_to_what_is_not_there_yet_stays_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [path, link] = ["volume.nii", "link.nii"].map(|name| folder.path().join(name));
    std::os::unix::fs::symlink("volume.nii", &link).expect("the folder takes it");
    let image = read(&Nifti::small().bytes());
    save(&link, image.grid(), image.voxels()).expect("the folder takes it");
    assert!(std::fs::symlink_metadata(&link).expect("it is there").is_symlink());
    assert_eq!(Image::open(&path).expect("it is whole"), image);
}
