//! What the header's fields mean.

use glam::{DAffine3, DMat3, DVec3};

use super::fields::Fields;
use crate::image::error::ImageError;
use crate::image::grid::Grid;
use crate::image::samples::{Endian, Number, Samples};

/// What a header says.
pub(super) struct Header {
    pub(super) grid: Grid,
    pub(super) samples: Samples,
    pub(super) gzip: bool,
}

/// An axis of the file: its length, and in space the vector from voxel to voxel.
struct Axis {
    length: u64,
    step: Option<DVec3>,
}

impl Header {
    pub(super) fn new(fields: &Fields) -> Result<Self, ImageError> {
        for name in ["byte skip", "byteskip", "line skip", "lineskip"] {
            match fields.get(name) {
                None | Some("0") => {}
                Some(value) => return Err(ImageError::field("byte or line skip", value, "0")),
            }
        }
        let number = number(fields.require("type")?)?;
        let endian = endian(fields, number)?;
        let gzip = match fields.require("encoding")? {
            "raw" => false,
            "gzip" | "gz" => true,
            other => return Err(ImageError::field("encoding", other, "raw or gzip")),
        };
        let samples = Samples { number, endian, slope: 1.0, intercept: 0.0 };
        Ok(Self { grid: grid(fields)?, samples, gzip })
    }
}

fn number(name: &str) -> Result<Number, ImageError> {
    Ok(match name {
        "signed char" | "int8" | "int8_t" => Number::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Number::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            Number::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Number::U16,
        "int" | "signed int" | "int32" | "int32_t" => Number::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Number::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Number::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            Number::U64
        }
        "float" => Number::F32,
        "double" => Number::F64,
        other => {
            let allowed = "an integer or a float of 8 to 64 bits, by one of the format's names";
            return Err(ImageError::field("type", other, allowed));
        }
    })
}

/// Numbers of one byte have no order.
fn endian(fields: &Fields, number: Number) -> Result<Endian, ImageError> {
    match (fields.get("endian"), number) {
        (Some("little"), _) | (None, Number::U8 | Number::I8) => Ok(Endian::Little),
        (Some("big"), _) => Ok(Endian::Big),
        (None, _) => Err(ImageError::Missing { name: "endian" }),
        (Some(other), _) => Err(ImageError::field("endian", other, "little or big")),
    }
}

fn grid(fields: &Fields) -> Result<Grid, ImageError> {
    let (axes, origin) = axes(fields)?;
    let (spatial, others): (Vec<Axis>, Vec<Axis>) =
        axes.into_iter().partition(|axis| axis.step.is_some());
    if let Some(axis) = others.iter().find(|axis| axis.length != 1) {
        return Err(ImageError::Series { count: axis.length });
    }
    let [x, y, z] = spatial.as_slice() else {
        let count = spatial.len().to_string();
        return Err(ImageError::field("the number of axes in space", count, "3"));
    };
    let dims = [x, y, z].map(|axis| u32::try_from(axis.length).unwrap_or(u32::MAX));
    let [x, y, z] = [x, y, z].map(|axis| axis.step.unwrap_or_default());
    Grid::new(dims, DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin))
}

/// The axes, and the middle of the first voxel, in metres. Without a space, the file's axes are taken to
/// run to the right, the front and the head.
fn axes(fields: &Fields) -> Result<(Vec<Axis>, DVec3), ImageError> {
    let lengths = lengths(fields)?;
    let Some(directions) = fields.get("space directions") else {
        let steps = spacings(fields.require("spacings")?, metres_per_unit(fields, "units")?)?;
        if fields.get("space").is_some() {
            // Which way the axes run in it is not said.
            return Err(ImageError::Missing { name: "space directions" });
        }
        return Ok((joined("spacings", lengths, steps)?, DVec3::ZERO));
    };
    let unit = metres_per_unit(fields, "space units")?;
    let patient = DMat3::from_diagonal(unit * signs(fields.require("space")?)?);
    let steps = vectors("space directions", directions)?.into_iter();
    let steps = steps.map(|step| step.map(|step| patient * step)).collect();
    let origin = match fields.get("space origin") {
        None => DVec3::ZERO,
        Some(text) => match vectors("space origin", text)?.as_slice() {
            &[Some(origin)] => patient * origin,
            _ => return Err(ImageError::field("space origin", text, "one vector")),
        },
    };
    Ok((joined("space directions", lengths, steps)?, origin))
}

fn joined(
    name: &'static str,
    lengths: Vec<u64>,
    steps: Vec<Option<DVec3>>,
) -> Result<Vec<Axis>, ImageError> {
    if lengths.len() != steps.len() {
        let value = format!("{} entries", steps.len());
        return Err(ImageError::field(name, value, "as long as the dimension"));
    }
    Ok(lengths.into_iter().zip(steps).map(|(length, step)| Axis { length, step }).collect())
}

fn lengths(fields: &Fields) -> Result<Vec<u64>, ImageError> {
    /// The most axes of the format.
    const MOST: usize = 16;
    let dimension = fields.require("dimension")?;
    let axes = match dimension.parse() {
        Ok(axes @ 1..=MOST) => axes,
        _ => return Err(ImageError::field("dimension", dimension, "1 to 16")),
    };
    let sizes = fields.require("sizes")?;
    let lengths: Result<Vec<u64>, _> = sizes.split_whitespace().map(str::parse).collect();
    match lengths {
        Ok(lengths) if lengths.len() == axes => Ok(lengths),
        _ => Err(ImageError::field("sizes", sizes, "as many whole numbers as the dimension")),
    }
}

/// Where a space's axes point to: 1 to the right, the front and the head.
fn signs(space: &str) -> Result<DVec3, ImageError> {
    match space.to_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Ok(DVec3::ONE),
        "left-anterior-superior" | "las" => Ok(DVec3::new(-1.0, 1.0, 1.0)),
        "left-posterior-superior" | "lps" => Ok(DVec3::new(-1.0, -1.0, 1.0)),
        _ => Err(ImageError::field("space", space, "that of a patient: RAS, LAS or LPS")),
    }
}

/// Metres per unit of length, by one of the fields; without a unit, everyone means millimetres.
fn metres_per_unit(fields: &Fields, field: &'static str) -> Result<f64, ImageError> {
    let units = fields.get(field).unwrap_or_default();
    // Each stands in quotation marks, empty ones for axes that are not in space.
    let marks = units.matches('"').count();
    let bare = units.split('"').step_by(2);
    if marks % 2 == 1 || bare.flat_map(str::chars).any(|letter| !letter.is_whitespace()) {
        return Err(ImageError::field(field, units, "in quotation marks, one for each axis"));
    }
    let mut names = units.split('"').skip(1).step_by(2).filter(|name| !name.is_empty());
    let first = names.next().unwrap_or("mm");
    let metres = match first {
        "m" => 1.0,
        "cm" => 1e-2,
        "mm" => 1e-3,
        "um" | "µm" => 1e-6,
        _ => return Err(ImageError::field(field, units, "m, cm, mm or um")),
    };
    if names.all(|name| name == first) {
        return Ok(metres);
    }
    Err(ImageError::field(field, units, "the same for all axes"))
}

/// The nth axis in space runs along the nth of the patient; one of spacing NaN is not in space.
fn spacings(text: &str, unit: f64) -> Result<Vec<Option<DVec3>>, ImageError> {
    let mut directions = DVec3::AXES.into_iter();
    let step = |word: &str| {
        let spacing: f64 =
            word.parse().map_err(|_| ImageError::field("spacings", text, "numbers"))?;
        if spacing.is_nan() {
            return Ok(None);
        }
        match directions.next() {
            Some(direction) => Ok(Some(unit * spacing * direction)),
            None => Err(ImageError::field("spacings", text, "those of three axes in space")),
        }
    };
    text.split_whitespace().map(step).collect()
}

/// Vectors like `(1,0,0)`, and `none`.
fn vectors(name: &'static str, text: &str) -> Result<Vec<Option<DVec3>>, ImageError> {
    let wrong = || ImageError::field(name, text, "vectors of three numbers, or none");
    let mut rest = text.trim();
    let mut vectors = Vec::new();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            vectors.push(None);
            rest = after.trim_start();
            continue;
        }
        let inner = rest.strip_prefix('(').ok_or_else(wrong)?;
        let (inner, after) = inner.split_once(')').ok_or_else(wrong)?;
        let numbers: Result<Vec<f64>, _> =
            inner.split(',').map(|number| number.trim().parse()).collect();
        let numbers: [f64; 3] = numbers.map_err(|_| wrong())?.try_into().map_err(|_| wrong())?;
        vectors.push(Some(numbers.into()));
        rest = after.trim_start();
    }
    Ok(vectors)
}
