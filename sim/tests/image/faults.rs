//! Files that must be refused, and what is said about them.

use std::fs;
use std::path::Path;

use dualframe_sim::image::{Grid, Image, write};
use glam::DAffine3;

use crate::files::{Nifti, gzip, nrrd, nrrd_bytes};

/// The file is refused with exactly this line.
fn refused(name: &str, file: &[u8], expected: &str) {
    match Image::read(file, file.len() as u64) {
        Ok(_) => panic!("{name}: it was read"),
        Err(error) => assert_eq!(error.to_string(), expected, "{name}"),
    }
}

/// As [`refused`], of a NIfTI file that `spoil` spoils, packed and not.
fn refused_nifti(name: &str, spoil: impl Fn(&mut Nifti), expected: &str) {
    let mut file = Nifti::small();
    spoil(&mut file);
    refused(name, &file.bytes(), expected);
    refused(name, &gzip(&file.bytes()), expected);
}

/// As [`refused`], of a raw NRRD file in which one line is another, or away if that is empty.
fn refused_nrrd(line: &str, other: &str, expected: &str) {
    let mut lines = nrrd("raw");
    let place = lines.iter().position(|found| found.starts_with(line)).expect("a line");
    lines[place] = other.to_owned();
    lines.retain(|line| !line.is_empty());
    refused(other, &nrrd_bytes(&lines, &Nifti::small().data), expected);
}

#[test]
fn no_image() {
    const MAGIC: &str = "neither NIfTI-1 nor NRRD";
    refused("empty", b"", "the file is empty");
    refused("short text", b"text", MAGIC);
    refused("short packed text", &gzip(b"text"), MAGIC);
    refused("text", &[b'a'; 400], MAGIC);
    refused("packed text", &gzip(&[b'a'; 400]), MAGIC);
    refused_nifti("no magic", |file| file.magic = [0; 4], MAGIC);
    refused_nifti("no size", |file| file.sizeof_hdr = 0, MAGIC);
    let only = "is not read: only NIfTI-1 in one file, and NRRD with its header attached, are";
    refused_nifti(
        "two files",
        |file| file.magic = *b"ni1\0",
        &format!("NIfTI-1 in two files {only}"),
    );
    refused_nifti("NIfTI-2", |file| file.sizeof_hdr = 540, &format!("NIfTI-2 {only}"));
    let detached = format!("NRRD with a detached header {only}");
    refused_nrrd("modality", "data file: head.raw", &detached);
    refused("without an empty line", b"NRRD0004\ndata file: head.raw\ntype: short\n", &detached);
    refused("a list of files", b"NRRD0004\ndata file: LIST\nhead-1.raw\nhead-2.raw\n", &detached);
}

#[test]
fn truncated() {
    let file = Nifti::small().bytes();
    let voxels = "cut off: it ends before the 24 bytes of its voxels";
    let header = "cut off: it ends before the 348 bytes of its header";
    let big = Nifti { big: true, ..Nifti::small() }.bytes();
    for length in [4, 347] {
        refused("NIfTI's header", &file[..length], header);
        refused("NIfTI's header, high bytes first", &big[..length], header);
        refused("NIfTI's packed header", &gzip(&file[..length]), header);
    }
    refused("shorter than what tells what it is", &file[..3], header);
    refused("NIfTI", &file[..file.len() - 1], voxels);
    refused("NIfTI's header", &file[..350], "cut off: it ends before the 352 bytes of its header");
    refused("packed before", &gzip(&file[..file.len() - 1]), voxels);
    let packed = gzip(&file);
    for length in [packed.len() - 1, packed.len() - 8, packed.len() - 9, 100, 10, 2] {
        let error = Image::read(&packed[..length], length as u64).expect_err("it is cut");
        assert!(error.to_string().starts_with("damaged gzip data: "), "{length}: {error}");
    }
    let file = nrrd_bytes(&nrrd("raw"), &Nifti::small().data);
    refused("NRRD", &file[..file.len() - 1], voxels);
    let header = "cut off: it ends before the 101 bytes of its header";
    refused("NRRD's header", &file[..100], header);
}

#[test]
fn shorter_than_its_length() {
    let file = Nifti::small().bytes();
    let error = Image::read(&file[..file.len() - 5], file.len() as u64).expect_err("it is cut");
    assert_eq!(error.to_string(), "cut off: it ends before the 24 bytes of its voxels");
    let error = Image::read(&*file, file.len() as u64 - 24).expect_err("it is longer");
    assert_eq!(error.to_string(), "cut off: it ends before the 24 bytes of its voxels");
}

#[test]
fn trailing() {
    const TRAILING: &str = "there is more data after the last voxel";
    refused_nifti("NIfTI", |file| file.data.push(0), TRAILING);
    let mut data = Nifti::small().data;
    data.push(0);
    refused("NRRD", &nrrd_bytes(&nrrd("raw"), &data), TRAILING);
    refused("packed NRRD", &nrrd_bytes(&nrrd("gzip"), &gzip(&data)), TRAILING);
    let mut packed = gzip(&Nifti::small().bytes());
    packed.push(b'x');
    refused("after gzip", &packed, "damaged gzip data: unexpected end of file");
    packed.extend([b'x'; 20]);
    refused("much after gzip", &packed, "damaged gzip data: invalid gzip header");
}

#[test]
fn damaged_gzip() {
    let mut packed = gzip(&Nifti::small().bytes());
    let checksum = packed.len() - 8;
    packed[checksum] ^= 1;
    let expected = "damaged gzip data: corrupt gzip stream does not have a matching checksum";
    refused("checksum", &packed, expected);
    let file = nrrd_bytes(&nrrd("gzip"), &Nifti::small().data);
    refused("not gzip", &file, "damaged gzip data: invalid gzip header");
}

#[test]
fn huge_headers() {
    refused_nifti(
        "terabytes",
        |file| file.dim = [3, i16::MAX, i16::MAX, i16::MAX, 1, 1, 1, 1],
        "[32767, 32767, 32767] voxels: each side must have 1 to 2048",
    );
    refused_nifti(
        "gigabytes",
        |file| file.dim = [3, 2048, 2048, 2048, 1, 1, 1, 1],
        "[2048, 2048, 2048] voxels: there may be 1073741824 in all",
    );
    refused_nrrd(
        "sizes",
        "sizes: 18446744073709551615 2 2",
        "[4294967295, 2, 2] voxels: each side must have 1 to 2048",
    );
    let huge = Nifti { dim: [3, 1024, 1024, 1024, 1, 1, 1, 1], ..Nifti::small() }.bytes();
    let expected = "cut off: it ends before the 2147483648 bytes of its voxels";
    refused("plain", &huge, expected);
    let packed = gzip(&huge);
    let most = 1032 * packed.len() - 352;
    let expected = format!(
        "its header promises 2147483648 bytes; a gzip file of its length holds at most {most}"
    );
    refused("packed", &packed, &expected);
    let offset = "vox_offset is \"1000000000000\": it must be a whole number from 352 to 16777216";
    refused_nifti("offset", |file| file.vox_offset = 1e12, offset);
    let long = format!("content: {}", "x".repeat(70_000));
    refused_nrrd("modality", &long, "its header does not end within 65536 bytes");
}

/// A hundred thousand times as much as the header says: it is not unpacked, or it would be found that it cannot be.
#[test]
fn gzip_bomb() {
    let bomb = Nifti { data: vec![0; 1 << 24], ..Nifti::small() };
    let packed = |file: &Nifti| {
        let mut packed = gzip(&file.bytes());
        packed[4_096..].fill(0xff);
        packed
    };
    refused("bomb", &packed(&bomb), "there is more data after the last voxel");
    let whole = packed(&Nifti { dim: [3, 256, 256, 128, 1, 1, 1, 1], ..bomb });
    let error = Image::read(&*whole, whole.len() as u64).expect_err("it is damaged");
    assert!(error.to_string().starts_with("damaged gzip data: "), "{error}");
}

#[test]
fn dimensions() {
    refused_nifti("none", |file| file.dim[0] = 0, "dim[0] is \"0\": it must be 3 to 7");
    refused_nifti("flat", |file| file.dim[0] = 2, "dim[0] is \"2\": it must be 3 to 7");
    refused_nifti("many", |file| file.dim[0] = 8, "dim[0] is \"8\": it must be 3 to 7");
    refused_nifti("negative", |file| file.dim[2] = -3, "dim is \"-3\": it must be positive");
    let side = "[2, 0, 2] voxels: each side must have 1 to 2048";
    refused_nifti("zero", |file| file.dim[2] = 0, side);
    let series = "2 values a voxel (time, colour, ...): only one volume is read";
    refused_nifti(
        "4D",
        |file| {
            file.dim = [4, 2, 3, 1, 2, 1, 1, 1];
        },
        series,
    );
    let mut lines = nrrd("raw");
    lines[3] = "dimension: 4".to_owned();
    lines[5] = "sizes: 2 3 1 2".to_owned();
    lines[6] = "space directions: none (1,0,0) (0,1,0) (0,0,1)".to_owned();
    refused("4D NRRD", &nrrd_bytes(&lines, &Nifti::small().data), series);
    refused_nrrd("dimension", "dimension: 17", "dimension is \"17\": it must be 1 to 16");
    let sizes = "it must be as many whole numbers as the dimension";
    refused_nrrd("sizes", "sizes: 12 1", &format!("sizes is \"12 1\": {sizes}"));
    refused_nrrd("sizes", "sizes: 2 -3 2", &format!("sizes is \"2 -3 2\": {sizes}"));
}

#[test]
fn types() {
    let datatype = "datatype is \"128\": it must be an integer or a float of 8 to 64 bits (2, 4, 8, \
                    16, 64, 256, 512, 768, 1024, 1280)";
    refused_nifti("colours", |file| file.datatype = 128, datatype);
    let bitpix = "bitpix is \"8\": it must be the number of bits of the datatype";
    refused_nifti("width", |file| file.bitpix = 8, bitpix);
    refused_nrrd(
        "type",
        "type: block",
        "type is \"block\": it must be an integer or a float of 8 to 64 bits, by one of the format's \
         names",
    );
    refused_nrrd("endian", "", "its header has no \"endian\"");
    refused_nrrd("endian", "endian: middle", "endian is \"middle\": it must be little or big");
    refused_nrrd("encoding", "encoding: ascii", "encoding is \"ascii\": it must be raw or gzip");
}

#[test]
fn scales() {
    let intercept = "scl_inter is \"inf\": it must be finite";
    refused_nifti("intercept", |file| file.scl = [1.0, f32::INFINITY], intercept);
    let units = "xyzt_units is \"5\": it must be 0 (unknown), 1 (m), 2 (mm) or 3 (µm) in its lowest \
                 three bits";
    refused_nifti("units", |file| file.xyzt_units = 5, units);
    let offset = "it must be a whole number from 352 to 16777216";
    for vox_offset in [f32::NAN, -1.0, 100.0, 352.5] {
        let expected = format!("vox_offset is \"{vox_offset}\": {offset}");
        refused_nifti("offset", |file| file.vox_offset = vox_offset, &expected);
    }
}

#[test]
fn affine_maps() {
    const FINITE: &str = "all its numbers must be finite, and the origin within 100 m";
    refused_nifti(
        "NaN",
        |file| file.srow[1][1] = f32::NAN,
        &format!("its affine map has the origin [0.0, 0.0, 0.0] m: {FINITE}"),
    );
    refused_nifti(
        "far",
        |file| file.srow[0][3] = 1e9,
        &format!("its affine map has the origin [1000000.0, 0.0, 0.0] m: {FINITE}"),
    );
    let skewed = "its axes span 0 of a cube of their lengths: it must be at least 0.5";
    refused_nifti(
        "singular",
        |file| {
            file.srow[2] = [0.0; 4];
            file.srow[0][2] = 1.0;
        },
        skewed,
    );
    let spacing = "voxels [0.001, 0.0, 0.001] m apart: the distances must be 0.000001 to 0.1 m";
    refused_nifti("empty axis", |file| file.srow[1] = [0.0; 4], spacing);
    let coarse = "voxels [0.001, 0.001, 1.0] m apart: the distances must be 0.000001 to 0.1 m";
    refused_nifti("coarse", |file| file.srow[2][2] = 1e3, coarse);
    refused_nifti(
        "quaternion",
        |file| (file.sform_code, file.qform_code, file.quatern) = (0, 1, [1.0, 1.0, 0.0]),
        "quatern_b, c, d is \"[1, 1, 0]\": it must be of a length of 1 at most",
    );
    refused_nifti(
        "distances",
        |file| (file.sform_code, file.pixdim[2]) = (0, -1.0),
        "pixdim[1..=3] is \"[1, -1, 1]\": it must be positive and finite",
    );
    refused_nrrd(
        "space directions",
        "space directions: (nan,0,0) (0,1,0) (0,0,1)",
        &format!("its affine map has the origin [0.0, 0.0, 0.0] m: {FINITE}"),
    );
}

#[test]
fn nrrd_fields() {
    let vectors = "it must be vectors of three numbers, or none";
    for text in ["(1,0,0) (0,1,0) 0,0,1", "(1,0,0) (0,1,0) (0,1)", "(1,0,0) (0,1,0) (0,0,1"] {
        let expected = format!("space directions is {text:?}: {vectors}");
        refused_nrrd("space directions", &format!("space directions: {text}"), &expected);
    }
    refused_nrrd(
        "space directions",
        "space directions: (1,0,0) (0,1,0)",
        "space directions is \"2 entries\": it must be as long as the dimension",
    );
    refused_nrrd(
        "space directions",
        "space directions: (1,0,0) (0,1,0) none",
        "2 values a voxel (time, colour, ...): only one volume is read",
    );
    let space = "space is \"scanner-xyz\": it must be that of a patient: RAS, LAS or LPS";
    refused_nrrd("space:", "space: scanner-xyz", space);
    refused_nrrd("space:", "", "its header has no \"space\"");
    refused_nrrd("space directions", "", "its header has no \"spacings\"");
    let first = "the first line is \"NRRD0009\": it must be NRRD0001 to NRRD0005";
    refused_nrrd("NRRD0004", "NRRD0009", first);
    let line = "it must be a field, a comment or a key with its value";
    let expected = format!("a line of the header is \"no colon\": {line}");
    refused_nrrd("modality", "no colon", &expected);
    let twice = "a line of the header is \"Type: int\": it must be the only one of its field";
    refused_nrrd("modality", "Type: int", twice);
    let units = "is \"\\\"inch\\\"\": it must be m, cm, mm or um";
    refused_nrrd("modality", "space units: \"inch\"", &format!("space units {units}"));
    let mut lines = nrrd("raw");
    lines.retain(|line| !line.starts_with("space"));
    lines.extend(["spacings: 1 1 1", "units: \"inch\""].map(str::to_owned));
    refused("units", &nrrd_bytes(&lines, &Nifti::small().data), &format!("units {units}"));
    for bare in ["um um um", "um \"mm\" \"mm\"", "\"um\" \"um\" \"um"] {
        let expected =
            format!("space units is {bare:?}: it must be in quotation marks, one for each axis");
        refused_nrrd("modality", &format!("space units: {bare}"), &expected);
    }
    refused_nrrd("modality", "byte skip: 4", "byte or line skip is \"4\": it must be 0");
}

#[test]
fn paths() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let error = Image::open(folder.path()).expect_err("a folder is no file");
    assert_eq!(error.to_string(), format!("{}: not a file", folder.path().display()));
    let path = folder.path().join("no.nii");
    let error = Image::open(&path).expect_err("there is no such file");
    assert!(error.to_string().starts_with(&format!("{}: No such file", path.display())), "{error}");
    fs::write(&path, "").expect("the folder takes it");
    let error = Image::open(&path).expect_err("it is empty");
    assert_eq!(error.to_string(), format!("{}: the file is empty", path.display()));
    if Path::new("/dev/zero").exists() {
        let error = Image::open(Path::new("/dev/zero")).expect_err("it has no end");
        assert_eq!(error.to_string(), "/dev/zero: not a file");
    }
    #[cfg(unix)]
    {
        // Whoever opens one is told something else; whoever opens a pipe waits.
        let path = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&path).expect("the folder takes it");
        let error = Image::open(&path).expect_err("a socket is no file");
        assert_eq!(error.to_string(), format!("{}: not a file", path.display()));
    }
}

#[test]
fn another_number_of_voxels() {
    let grid = Grid::new([2, 3, 2], DAffine3::from_scale([1e-3; 3].into())).expect("it is sound");
    let expected = "11 values were given for 12 voxels";
    let error = write(&mut Vec::new(), &grid, &[0_u8; 11]).expect_err("one is missing");
    assert_eq!(error.to_string(), expected);
    let error = Image::new(grid, vec![0; 11]).expect_err("one is missing");
    assert_eq!(error.to_string(), expected);
}
