//! The files that a run is to write. They are opened before any work is done: an hour's run must not end
//! in "no such folder".

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, StdoutLock, Write};
use std::ops::Deref;
#[cfg(unix)]
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use dualframe_sim::timeline::Timeline;
use serde::Serialize;

use super::args::Products;
use super::error::RunError;
use super::pictures::{file_of_frame, frame_of};

/// Where systems have it, the file that standard output goes to.
const STANDARD_OUTPUT: &str = "/dev/stdout";

/// The files that a run is to write; what is in them is not touched yet.
pub(super) struct Outputs {
    pub(super) json: Option<Output>,
    pub(super) picture: Option<Output>,
    pub(super) trace: Option<Output>,
    pub(super) record: Option<Output>,
    /// Where an image is saved.
    pub(super) save: Option<Output>,
}

impl Outputs {
    /// Opens `save` and what `args` name, none of which may be `input`, and makes the folder for the pictures
    /// of all frames.
    pub(super) fn open(
        args: &Products,
        save: Option<&Path>,
        input: Option<&Path>,
    ) -> Result<Self, String> {
        if let Some(folder) = &args.frames_out {
            make_folder(folder)?;
            Output::open(&file_of_frame(folder, 0))?;
        }
        let open = |path: Option<&Path>| path.map(Output::open).transpose();
        let outputs = Self {
            json: open(args.json.as_deref())?,
            picture: open(args.picture.as_deref())?,
            trace: open(args.trace.as_deref())?,
            record: open(args.record.as_deref())?,
            save: open(save)?,
        };
        let Self { json, picture, trace, record, save } = &outputs;
        let written = [json, picture, trace, record, save].into_iter().flatten();
        let files: Vec<&Path> = written.map(Output::path).chain(input).collect();
        check_distinct(files.iter().copied())?;
        if let Some(folder) = &args.frames_out {
            check_no_frame(folder, &files)?;
        }
        Ok(outputs)
    }

    /// Writes what a timeline has, where there are one and a file for it.
    pub(super) fn write_trace(&self, timeline: Option<&Timeline>) -> Result<(), RunError> {
        let Some((file, timeline)) = self.trace.as_ref().zip(timeline) else { return Ok(()) };
        file.replace(|writer| timeline.write_chrome_trace(writer))
    }
}

/// A file that will be written. One that was not there before goes if nothing was written.
pub(super) struct Output {
    file: File,
    path: PathBuf,
    is_new: bool,
}

impl Output {
    /// Opens it, without touching what is in it yet.
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        let open = |is_new: bool| {
            let mut options = OpenOptions::new();
            options.write(true).create(!is_new).create_new(is_new).truncate(false).open(path)
        };
        let (opened, is_new) = match open(true) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => (open(false), false),
            opened => (opened, true),
        };
        let file = opened.map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        Ok(Self { file, path: path.to_owned(), is_new })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes it anew.
    pub(super) fn replace(
        &self,
        write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
    ) -> Result<(), RunError> {
        let written = empty(&self.file).and_then(|()| {
            let mut writer = BufWriter::new(&self.file);
            write(&mut writer)?;
            writer.flush()
        });
        written.map_err(|source| RunError::Write { path: self.path.clone(), source })
    }

    /// Writes it anew, as one JSON object.
    pub(super) fn write_json(&self, value: &impl Serialize) -> Result<(), RunError> {
        self.replace(|writer| {
            serde_json::to_writer(&mut *writer, value)?;
            writer.write_all(b"\n")
        })
    }
}

impl Deref for Output {
    type Target = File;

    fn deref(&self) -> &File {
        &self.file
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        let is_empty = |found: Metadata| found.is_file() && found.len() == 0;
        if self.is_new && fs::symlink_metadata(&self.path).is_ok_and(is_empty) {
            // At worst an empty file stays.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Sees that no two of some files, and none of them and standard output, are the same one: what is in it would be
/// lost.
pub(super) fn check_distinct<'a>(paths: impl Iterator<Item = &'a Path>) -> Result<(), String> {
    let mut known: Vec<(&Path, Identity)> = Vec::new();
    let printed = identity(Path::new(STANDARD_OUTPUT));
    for path in paths {
        let Some(identity) = identity(path) else { continue };
        if printed.as_ref() == Some(&identity) {
            return Err(format!("{} is where the report is printed", path.display()));
        }
        if let Some((same, _)) = known.iter().find(|(_, known)| *known == identity) {
            let (one, other) = (same.display(), path.display());
            return Err(format!("{one} and {other} are the same file"));
        }
        known.push((path, identity));
    }
    Ok(())
}

/// Sees that none of some files is one that a frame's picture goes to.
fn check_no_frame(folder: &Path, paths: &[&Path]) -> Result<(), String> {
    let folder = fs::canonicalize(folder).ok();
    let is_frame = |path: &&Path| {
        let found = fs::canonicalize(path).ok();
        found.is_some_and(|found| found.parent() == folder.as_deref() && frame_of(&found).is_some())
    };
    match paths.iter().copied().find(is_frame) {
        Some(path) => Err(format!("{} is where a frame's picture goes", path.display())),
        None => Ok(()),
    }
}

/// What a file is told from others by: its device and number.
#[cfg(unix)]
type Identity = (u64, u64);
#[cfg(not(unix))]
type Identity = PathBuf;

/// `None` for what is no file: several may write to a pipe or a device.
fn identity(path: &Path) -> Option<Identity> {
    let found = fs::metadata(path).ok().filter(Metadata::is_file)?;
    #[cfg(unix)]
    return Some((MetadataExt::dev(&found), MetadataExt::ino(&found)));
    #[cfg(not(unix))]
    return fs::canonicalize(path).ok().filter(|_| found.is_file());
}

/// Makes a folder if it is not there.
pub(super) fn make_folder(path: &Path) -> Result<(), String> {
    let made = fs::create_dir_all(path);
    made.map_err(|error| format!("cannot make the folder {}: {error}", path.display()))
}

/// Empties a file, which is then written from its beginning.
pub(super) fn empty(file: &File) -> io::Result<()> {
    // Pipes and devices have no length.
    if file.metadata()?.is_file() {
        file.set_len(0)?;
    }
    Ok(())
}

/// Prints what came of a run.
pub(super) fn print(
    write: impl FnOnce(&mut StdoutLock<'_>) -> io::Result<()>,
) -> Result<(), RunError> {
    let mut out = io::stdout().lock();
    match write(&mut out).and_then(|()| out.flush()) {
        // Who has closed a pipe wants no more.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(RunError::Print(error)),
        _ => Ok(()),
    }
}
