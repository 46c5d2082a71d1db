//! The folder that experiments write into.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::PAGE;
use super::error::ExperimentError;

/// What the name of a file ends in that is not whole yet.
const PART: &str = "part";

/// Sees that a folder is there and takes new files, without leaving one in it: what would be written after an hour
/// should not be found out then.
///
/// # Errors
/// It is not there, or takes none.
pub fn check(folder: &Path) -> Result<(), ExperimentError> {
    let page = folder.join(PAGE);
    if page.is_dir() {
        let source = io::ErrorKind::IsADirectory.into();
        return Err(ExperimentError::Write { path: page, source });
    }
    let part = part_of(&page);
    let written = write_new(&part, b"?");
    let removed = fs::remove_file(&part);
    written
        .and(removed)
        .map_err(|source| ExperimentError::Write { path: folder.to_owned(), source })
}

/// Writes a file anew. What was in it stays until all of the new is on the disk: one that is full, or an interrupt,
/// costs nothing older.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let part = part_of(path);
    let replaced = write_new(&part, bytes).and_then(|()| fs::rename(&part, path));
    if replaced.is_err() {
        // At worst a part stays, for the next one to be written over.
        let _ = fs::remove_file(&part);
    }
    replaced
}

/// Where a file is until it is whole: beside its place, for nothing can be renamed from one disk to another.
fn part_of(path: &Path) -> PathBuf {
    path.with_added_extension(PART)
}

fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    // Some systems say only then that there is no room.
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn what_was_there_stays_until_the_new_is_whole() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [file, kept] = ["file.csv", "kept"].map(|name| folder.path().join(name));
        fs::write(&file, "old").expect("it can be written");
        // Another name for the old bytes, which are not written over.
        fs::hard_link(&file, &kept).expect("one disk");
        replace(&file, b"new").expect("it can be written");
        let read = |path| fs::read_to_string(path).expect("it is there");
        assert_eq!([&file, &kept].map(read), ["new", "old"]);
        fs::create_dir(part_of(&file)).expect("it is free");
        replace(&file, b"newer").expect_err("a folder stands where the part goes");
        assert_eq!(read(&file), "new");
    }

    #[test]
    fn a_check_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        check(folder.path()).expect("it takes files");
        assert_eq!(names(folder.path()), [""; 0]);
        let error = check(&folder.path().join("none")).expect_err("it is not there");
        assert!(error.to_string().ends_with("none"), "{error}");
        #[cfg(target_os = "linux")]
        check(Path::new("/proc")).expect_err("nobody can make a file there");
    }

    #[test]
    fn what_fails_leaves_no_part() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).expect("a folder");
        replace(&taken, b"new").expect_err("a folder is no file");
        assert_eq!(names(folder.path()), ["taken"]);
    }
}
