//! What is read is what was written, where it was written.

use dualframe_sim::image::{Grid, Image, ImageError, Thresholds, Voxel, write};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use proptest::prelude::*;

use crate::files::{NUMBERS, Nifti, gzip, nrrd, nrrd_bytes};

pub(crate) fn read(file: &[u8]) -> Image {
    Image::read(file, file.len() as u64).expect("the file is sound")
}

/// A file's axes in any order and any directions, turned by up to 0.3 rad.
fn affines() -> impl Strategy<Value = DAffine3> {
    let order = Just([0_usize, 1, 2]).prop_shuffle();
    let spacing = prop::array::uniform3(0.000_3..0.005_f64);
    let numbers = prop::array::uniform3(-1.0..1.0_f64);
    let origin = prop::array::uniform3(-0.3..0.3_f64);
    (order, any::<[bool; 3]>(), spacing, numbers, origin).prop_map(
        |(order, reversed, spacing, turn, origin)| {
            let turn = DMat3::from_quat(DQuat::from_scaled_axis(0.17 * DVec3::from(turn)));
            let column = |axis: usize| {
                let length = if reversed[axis] { -spacing[axis] } else { spacing[axis] };
                turn * DVec3::AXES[order[axis]] * length
            };
            let matrix = DMat3::from_cols(column(0), column(1), column(2));
            DAffine3::from_mat3_translation(matrix, origin.into())
        },
    )
}

fn dims() -> impl Strategy<Value = [u32; 3]> {
    prop::array::uniform3(1..7_u32)
}

/// Checks that every stored value is at its place in the patient, and that the image's axes run to the
/// right, the front and the head. `precision` is that of the affine map, in metres.
fn check(image: &Image, dims: [u32; 3], affine: DAffine3, precision: f64, expected: &[i16]) {
    let grid = image.grid();
    assert_eq!(grid.stored_dims(), dims);
    assert!(grid.stored_affine().abs_diff_eq(affine, precision), "{:?}", grid.stored_affine());
    let matrix = grid.affine().matrix3;
    for (number, column) in [matrix.x_axis, matrix.y_axis, matrix.z_axis].into_iter().enumerate() {
        assert!(column[number] > 0.9 * column.length(), "axis {number} is {column}");
    }
    assert_eq!(image.voxels().len(), expected.len());
    let to_voxel = grid.affine().inverse();
    let [wide, high, _] = grid.dims();
    for (number, &value) in expected.iter().enumerate() {
        let number = number as u32;
        let stored = [number % dims[0], number / dims[0] % dims[1], number / dims[0] / dims[1]];
        let place = affine.transform_point3(DVec3::from(stored.map(f64::from)));
        let exact = to_voxel.transform_point3(place);
        assert!(exact.abs_diff_eq(exact.round(), 0.1), "{exact} is not in the middle of a voxel");
        let [x, y, z] = exact.round().to_array().map(|index| index as u32);
        assert_eq!(image.voxels()[((z * high + y) * wide + x) as usize], value, "at {x} {y} {z}");
    }
}

proptest! {
    // A file of failed seeds would lie among the tests; the message shows the case itself.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nifti(
        dims in dims(), affine in affines(), number in 0..NUMBERS.len(), big: bool, packed: bool,
        qform: bool, scaled: bool, extension in 0..3_usize, seed: u64,
    ) {
        let number = &NUMBERS[number];
        let values = number.values(dims.iter().product::<u32>() as usize, seed);
        let mut file = Nifti { big, datatype: number.datatype, bitpix: number.bits, ..Nifti::small() };
        dims.iter().zip(&mut file.dim[1..]).for_each(|(&side, dim)| *dim = side as i16);
        if qform { file.set_qform(affine) } else { file.set_sform(affine) }
        if scaled { file.scl = [2.0, -1_024.0] }
        file.extension = vec![7; 4 + 16 * extension];
        file.vox_offset += 16.0 * extension as f32;
        file.data = number.encode(&values, big);
        let bytes = if packed { gzip(&file.bytes()) } else { file.bytes() };
        let scale = |value: i16| if scaled { 2 * value - 1_024 } else { value };
        // A qform leaves a quaternion's real part to be found from the others, which near a half turn
        // takes all but three digits of it.
        let precision = if qform { 1e-5 } else { 1e-7 };
        check(&read(&bytes), dims, affine, precision, &values.into_iter().map(scale).collect::<Vec<_>>());
    }

    #[test]
    fn nrrd_files(
        dims in dims(), affine in affines(), number in 0..NUMBERS.len(), big: bool, packed: bool,
        space in 0..3_usize, with_time: bool, metres: bool, carriage_return: bool, seed: u64,
    ) {
        let number = &NUMBERS[number];
        let values = number.values(dims.iter().product::<u32>() as usize, seed);
        let (space, x, y) = [("RAS", 1.0, 1.0), ("left-anterior-superior", -1.0, 1.0), ("LPS", -1.0, -1.0)][space];
        let (unit, scale) = if metres { ("m", 1.0) } else { ("mm", 1e3) };
        let vector = |v: DVec3| format!("({}, {},{})", scale * x * v.x, scale * y * v.y, scale * v.z);
        let matrix = affine.matrix3;
        let steps = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(vector).join(" ");
        let (none, one, dimension) = if with_time { (" none", " 1", 4) } else { ("", "", 3) };
        let [width, height, depth] = dims;
        let mut lines = vec![
            "NRRD0005".to_owned(),
            format!("type: {}", number.name),
            format!("dimension: {dimension}"),
            format!("space: {space}"),
            format!("sizes: {width} {height} {depth}{one}"),
            format!("space directions: {steps}{none}"),
            format!("Space Origin: {}", vector(affine.translation)),
            format!("space units: \"{unit}\" \"{unit}\" \"{unit}\""),
            format!("encoding: {}", if packed { "gzip" } else { "raw" }),
        ];
        if number.bits > 8 {
            lines.push(format!("endian: {}", if big { "big" } else { "little" }));
        }
        let end = if carriage_return { "\r" } else { "" };
        let lines: Vec<String> = lines.into_iter().chain([String::new()]).map(|l| l + end).collect();
        let data = number.encode(&values, big);
        let data = if packed { gzip(&data) } else { data };
        // The empty line is one of the lines here.
        let mut bytes = nrrd_bytes(&lines, &[]);
        bytes.pop();
        bytes.extend(data);
        check(&read(&bytes), dims, affine, 1e-9, &values);
    }

    #[test]
    fn written(dims in dims(), affine in affines(), seed: u64) {
        let grid = Grid::new(dims, affine).expect("the grid is sound");
        let values = NUMBERS[3].values(grid.voxels(), seed);
        same(&grid, &values);
        same(&grid, &values.iter().map(|&value| value.unsigned_abs()).collect::<Vec<u16>>());
        same(&grid, &values.iter().map(|&value| value as u8).collect::<Vec<u8>>());
    }
}

/// Writes and reads, twice: the second time nothing at all may change.
fn same<V: Voxel + Into<i32>>(grid: &Grid, values: &[V]) {
    let mut file = Vec::new();
    write(&mut file, grid, values).expect("memory takes all");
    let image = read(&file);
    let numbers: Vec<i32> = image.voxels().iter().map(|&number| number.into()).collect();
    assert_eq!(numbers, values.iter().map(|&value| value.into()).collect::<Vec<i32>>());
    assert_eq!(image.grid().stored_dims(), grid.stored_dims());
    assert!(image.grid().stored_affine().abs_diff_eq(grid.stored_affine(), 1e-7));
    let mut again = Vec::new();
    write(&mut again, image.grid(), values).expect("memory takes all");
    assert_eq!(again, file);
}

/// As other readers have it.
#[test]
fn without_a_slope_numbers_are_what_they_are() {
    for scl in [[0.0, 5.0], [f32::NAN, 0.0], [f32::NAN; 2], [f32::INFINITY, 5.0]] {
        let file = Nifti { scl, ..Nifti::small() };
        assert_eq!(read(&file.bytes()), read(&Nifti::small().bytes()), "{scl:?}");
    }
}

/// The standard's method 3 before method 2 before method 1.
#[test]
fn sform_before_qform_before_distances() {
    let mut file = Nifti { pixdim: [1.0, 2.0, 3.0, 4.0, 1.0, 1.0, 1.0, 1.0], ..Nifti::small() };
    file.qoffset = [5.0, 6.0, 7.0];
    file.srow[0][3] = 8.0;
    let cases = [
        (1, 1, [0.001, 0.001, 0.001], [0.008, 0.0, 0.0]),
        (1, 0, [0.002, 0.003, 0.004], [0.005, 0.006, 0.007]),
        (0, 0, [0.002, 0.003, 0.004], [0.0, 0.0, 0.0]),
    ];
    for (qform_code, sform_code, spacing, origin) in cases {
        let image = read(&Nifti { qform_code, sform_code, ..file.clone() }.bytes());
        let affine = image.grid().affine();
        assert!(image.grid().spacing().abs_diff_eq(spacing.into(), 1e-9), "{affine}");
        assert!(affine.translation.abs_diff_eq(origin.into(), 1e-9), "{affine}");
    }
}

#[test]
fn units() {
    for (xyzt_units, spacing) in [(0, 1e-3), (2, 1e-3), (10, 1e-3), (3, 1e-6)] {
        let image = read(&Nifti { xyzt_units, ..Nifti::small() }.bytes());
        assert!(image.grid().spacing().abs_diff_eq(DVec3::splat(spacing), 1e-12), "{xyzt_units}");
    }
}

/// Distances without directions: the axes run to the right, the front and the head.
#[test]
fn nrrd_of_spacings() {
    let mut lines = nrrd("raw");
    lines.retain(|line| !line.starts_with("space"));
    lines.push("spacings: 0.5 0.6 0.7".to_owned());
    let image = read(&nrrd_bytes(&lines, &Nifti::small().data));
    assert_eq!(image.voxels(), read(&Nifti::small().bytes()).voxels());
    assert!(image.grid().spacing().abs_diff_eq(DVec3::new(0.5e-3, 0.6e-3, 0.7e-3), 1e-12));
    // Which way its axes run in that space is not said.
    lines.push("space: left-posterior-superior".to_owned());
    let file = nrrd_bytes(&lines, &Nifti::small().data);
    let error = Image::read(&file[..], file.len() as u64).expect_err("it lacks them");
    assert!(matches!(error, ImageError::Missing { name: "space directions" }), "{error}");
}

#[test]
fn four_axes_with_one_volume() {
    let file = Nifti { dim: [5, 2, 3, 2, 1, 1, 9, 9], ..Nifti::small() };
    assert_eq!(read(&file.bytes()), read(&Nifti::small().bytes()));
}

#[test]
fn numbers_beyond_16_bits() {
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e9, -1e9, 0.5, -0.4, 1.6];
    let expected = [-1_000, i16::MAX, i16::MIN, i16::MAX, i16::MIN, 1, 0, 2];
    let data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let dim = [3, 2, 2, 2, 1, 1, 1, 1];
    let file = Nifti { dim, datatype: 16, bitpix: 32, data, ..Nifti::small() };
    assert_eq!(read(&file.bytes()).voxels(), expected);
}

/// A gzip file of several members is their contents one after the other (RFC 1952, section 2.2).
#[test]
fn gzip_in_members() {
    let file = Nifti::small().bytes();
    let members = file.chunks(100).flat_map(gzip).collect::<Vec<u8>>();
    assert_eq!(read(&members), read(&file));
}

#[test]
fn bone() {
    let image = read(&Nifti::small().bytes());
    let thresholds = Thresholds::default();
    let bone = image.bone(&thresholds).expect("there is bone");
    let expected = [0, 0, 0, 0, 0, 51, 101, 135, 149, 164, 178, 193];
    assert_eq!(bone, expected);
    let harder = Thresholds::new(-300, 100, 451, 662).expect("they ascend");
    let error = image.bone(&harder).expect_err("there is none");
    let expected = "no bone: no voxel is above 450 HU, and trabecular bone begins at 451 HU";
    assert_eq!(error.to_string(), expected);
}
