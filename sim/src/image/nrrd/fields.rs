//! The header's lines.

use std::collections::BTreeMap;
use std::io::{BufRead, Read};

use crate::image::error::ImageError;

/// The most bytes of a header.
const MOST: u64 = 65_536;

/// The fields by their names in lower case.
pub(super) struct Fields(BTreeMap<String, String>);

impl Fields {
    /// Reads lines up to the empty one that ends a header; and the number of bytes they take.
    pub(super) fn read(source: &mut impl BufRead) -> Result<(Self, u64), ImageError> {
        let mut source = source.take(MOST);
        let mut fields = BTreeMap::new();
        let mut line = Vec::new();
        let mut first = true;
        loop {
            line.clear();
            source.read_until(b'\n', &mut line)?;
            if line.pop_if(|byte| *byte == b'\n').is_none() {
                return match source.limit() {
                    0 => Err(ImageError::Header { most: MOST }),
                    left => Err(ImageError::Truncated { part: "header", needed: MOST - left + 1 }),
                };
            }
            line.pop_if(|byte| *byte == b'\r');
            let text = String::from_utf8_lossy(&line);
            if first {
                version(&text)?;
                first = false;
            } else if text.is_empty() {
                return Ok((Self(fields), MOST - source.limit()));
            } else {
                insert(&mut fields, &text)?;
            }
        }
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    pub(super) fn require(&self, name: &'static str) -> Result<&str, ImageError> {
        self.get(name).ok_or(ImageError::Missing { name })
    }
}

fn version(line: &str) -> Result<(), ImageError> {
    match line.strip_prefix("NRRD000") {
        Some("1" | "2" | "3" | "4" | "5") => Ok(()),
        _ => Err(ImageError::field("the first line", line, "NRRD0001 to NRRD0005")),
    }
}

fn insert(fields: &mut BTreeMap<String, String>, line: &str) -> Result<(), ImageError> {
    let wrong = |allowed| Err(ImageError::field("a line of the header", line, allowed));
    if line.starts_with('#') {
        return Ok(());
    }
    // A key with its value, which mean nothing here; it may have a colon, but none before a space.
    let is_key = |at| line.find(": ").is_none_or(|field| at < field);
    if line.find(":=").is_some_and(is_key) {
        return Ok(());
    }
    let Some((name, value)) = line.split_once(':') else {
        return wrong("a field, a comment or a key with its value");
    };
    let name = name.trim().to_lowercase();
    // What follows may be a list of files, which are no fields, and end without an empty line.
    if name == "data file" || name == "datafile" {
        return Err(ImageError::Kind { kind: "NRRD with a detached header" });
    }
    match fields.insert(name, value.trim().to_owned()) {
        None => Ok(()),
        Some(_) => wrong("the only one of its field"),
    }
}
