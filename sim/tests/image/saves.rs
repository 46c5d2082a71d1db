//! What is saved is whole, or what was there is.

#[cfg(unix)]
use std::{fs, path::Path, process::Command};

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

/// Zeros, 256 KiB of them.
#[cfg(unix)]
fn zeros() -> Image {
    let grid = Grid::new([64; 3], DAffine3::from_scale(DVec3::splat(1e-3))).expect("allowed");
    let voxels = vec![0; grid.voxels()];
    Image::new(grid, voxels).expect("one for each")
}

/// Saves [`zeros`] as bytes and prints how that went, for the tests that run it within limits.
#[cfg(unix)]
#[test]
#[ignore = "run by other tests, within limits"]
fn saves_and_tells() {
    let path = std::env::var_os("DUALFRAME_TEST_IMAGE").expect("the other test says where");
    let image = zeros();
    match save(path.as_ref(), image.grid(), &vec![0_u8; image.voxels().len()]) {
        Ok(()) => println!("it is saved"),
        Err(error) => println!("{error}"),
    }
}

/// What [`saves_and_tells`] prints of a path if it is run by a command.
#[cfg(unix)]
fn told(command: &[&str], path: &Path) -> String {
    let child = Command::new(command[0])
        .args(&command[1..])
        .arg(std::env::current_exe().expect("this one"))
        .args(["--ignored", "--exact", "--nocapture", "saves::saves_and_tells"])
        .env("DUALFRAME_TEST_IMAGE", path)
        .output()
        .expect("there is such a command");
    let told = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && told.contains("1 passed"), "{told}");
    told.into_owned()
}

/// Where no file may be longer than a few kilobytes, as on a full disk, the image that was there stays.
#[cfg(unix)]
#[test]
fn a_full_disk_keeps_what_was_there() {
    use std::os::unix::fs::{PermissionsExt, symlink};

    let folder = tempfile::tempdir().expect("a temporary folder");
    let (path, link) = (folder.path().join("volume.nii"), folder.path().join("link.nii"));
    let image = read(&Nifti::small().bytes());
    save(&path, image.grid(), image.voxels()).expect("the folder takes it");
    symlink("volume.nii", &link).expect("the folder takes it");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("it is ours");
    let told = told(&["sh", "-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""], &link);
    assert!(told.contains("too large"), "{told}");
    assert_eq!(Image::open(&path).expect("it is whole"), image);
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2, "something is left");

    let changed = vec![7_i16; image.voxels().len()];
    save(&link, image.grid(), &changed).expect("there is room");
    assert_eq!(Image::open(&path).expect("it is whole").voxels(), changed);
    assert!(fs::symlink_metadata(&link).expect("it is there").is_symlink());
    let mode = fs::metadata(&path).expect("it is there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600, "others may read it");
    if Path::new("/dev/full").exists() {
        save("/dev/full".as_ref(), image.grid(), &changed).expect_err("it is full");
    }
}

/// As on a disk that knows no permissions, where these are not ours to change.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "needs strace"]
fn odd_disk_without_permissions() {
    let command = ["strace", "-f", "-o", "/dev/null", "-e", "inject=fchmod:error=EPERM"];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("volume.nii");
    fs::write(&path, "another").expect("the folder takes it");
    let told = told(&command, &path);
    assert!(told.contains("it is saved"), "{told}");
    assert_eq!(Image::open(&path).expect("it is whole"), zeros());
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1, "something is left");
}

/// A program that runs may not be written, by root neither.
#[cfg(target_os = "linux")]
#[test]
fn a_file_that_may_not_be_written_stays() {
    let test = std::env::current_exe().expect("this one");
    let folder = tempfile::tempdir_in(test.parent().expect("a folder")).expect("it takes one");
    let path = folder.path().join("volume.nii");
    fs::hard_link(test, &path).expect("the folder takes it");
    let image = read(&Nifti::small().bytes());
    let error = save(&path, image.grid(), image.voxels()).expect_err("it runs");
    assert!(error.to_string().contains("Text file busy"), "{error}");
    assert!(Image::open(&path).is_err(), "it is an image");
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1, "something is left");
}

/// A file that is mounted alone, whose place nothing takes: on a disk with room, and on one without.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "mounts, which not every machine lets anybody do"]
fn odd_disk_where_nothing_is_moved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [path, there] = ["volume.nii", "there.nii"].map(|name| folder.path().join(name));
    let mounts = ["unshare", "--map-root-user", "--mount", "sh", "-c"];
    for file in [&path, &there] {
        fs::write(file, "another").expect("the folder takes it");
    }
    let mounted = |script: &str| {
        let script =
            format!("cd \"${{DUALFRAME_TEST_IMAGE%/*}}\" && {script} && exec \"$0\" \"$@\"");
        told(&[&mounts[..], &[&script]].concat(), &path)
    };
    let told = mounted("mount --bind there.nii volume.nii");
    assert!(told.contains("it is saved"), "{told}");
    assert_eq!(Image::open(&there).expect("it is whole"), zeros());
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2, "something is left");

    let small = "mkdir small && mount -t tmpfs -o size=16k none small && touch small/there.nii";
    let told = mounted(&format!("{small} && mount --bind small/there.nii volume.nii"));
    assert!(told.contains("No space left on device"), "{told}");
    let beside =
        told.split("what was to be there is in ").nth(1).and_then(|rest| rest.lines().next());
    let beside = beside.expect("it says where it is");
    assert_eq!(Image::open(beside.as_ref()).expect("it is whole"), zeros());
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
