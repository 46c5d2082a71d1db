//! The files that a run is to write. They are opened before any work is done: an hour's run must not end
//! in "no such folder".

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use serde::Serialize;

use super::args::Products;
use super::error::RunError;
use super::pictures::file_of_frame;

/// The files that a run is to write; what is in them is not touched yet.
pub(super) struct Outputs {
    pub(super) json: Option<File>,
    pub(super) picture: Option<File>,
    pub(super) trace: Option<File>,
    pub(super) record: Option<File>,
}

impl Outputs {
    /// Opens what `args` name, and makes the folder for the pictures of all frames.
    pub(super) fn open(args: &Products) -> Result<Self, String> {
        if let Some(folder) = &args.frames_out {
            make_folder(folder)?;
            open(&file_of_frame(folder, 0))?;
        }
        let open = |path: &Option<_>| path.as_deref().map(open).transpose();
        Ok(Self {
            json: open(&args.json)?,
            picture: open(&args.picture)?,
            trace: open(&args.trace)?,
            record: open(&args.record)?,
        })
    }
}

/// Opens a file that will be written, without touching what is in it yet.
pub(super) fn open(path: &Path) -> Result<File, String> {
    let opened = OpenOptions::new().write(true).create(true).truncate(false).open(path);
    opened.map_err(|error| format!("cannot write {}: {error}", path.display()))
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

/// Writes a file anew.
pub(super) fn replace<'a>(
    file: &'a File,
    write: impl FnOnce(&mut BufWriter<&'a File>) -> io::Result<()>,
) -> io::Result<()> {
    empty(file)?;
    let mut writer = BufWriter::new(file);
    write(&mut writer)?;
    writer.flush()
}

/// Writes a file anew, as one JSON object.
pub(super) fn write_json(file: &File, value: &impl Serialize) -> Result<(), RunError> {
    let written = replace(file, |writer| {
        serde_json::to_writer(&mut *writer, value)?;
        writer.write_all(b"\n")
    });
    written.map_err(RunError::Json)
}
