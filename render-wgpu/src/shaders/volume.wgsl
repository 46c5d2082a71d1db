// Volumes: a ray through the box of a grid of densities, to where the density is one half.
//
// The box's far sides are drawn, which are there from inside it too, and each pixel marches from where
// the view enters the box. What it finds has a depth of its own, so volumes and surfaces hide each other
// in whatever order they are drawn.

struct Grid {
    // Where and how it is turned: rotation as a quaternion, then the place of its corner.
    rotation: vec4f,
    place: vec3f,
    // Voxels of a step.
    step: f32,
    // The distances between voxels, in metres.
    spacing: vec3f,
    // The cells' side, in voxels.
    cell: f32,
    color: vec4f,
}

@group(1) @binding(0) var<uniform> grid: Grid;
@group(1) @binding(1) var densities: texture_3d<f32>;
// The greatest density that is interpolated in each cell. A cell begins at the middle of its first voxel.
@group(1) @binding(2) var peaks: texture_3d<f32>;
@group(1) @binding(3) var linear_sampler: sampler;

// The surface's density.
const SURFACE = 0.5;
// What fills spongy bone.
const MARROW = vec3f(0.50, 0.13, 0.08);

// From the world to voxels: a direction.
fn along_voxels(direction: vec3f) -> vec3f {
    return turned(vec4f(-grid.rotation.xyz, grid.rotation.w), direction) / grid.spacing;
}

fn in_voxels(position: vec3f) -> vec3f {
    return along_voxels(position - grid.place);
}

fn sides() -> vec3f {
    return vec3f(textureDimensions(densities));
}

fn density(at: vec3f) -> f32 {
    return textureSampleLevel(densities, linear_sampler, at / sides(), 0.0).r;
}

// The outward normal at a place, of any length, in the world: central differences, each the mean of the
// four between corners of a cube around the place. Along the axes alone, steps between voxels would show.
fn outward(at: vec3f) -> vec3f {
    var difference = vec3f(0.0);
    for (var k = 0u; k < 8u; k++) {
        let side = vec3f((vec3u(k) >> vec3u(0u, 1u, 2u)) & vec3u(1u)) * 2.0 - 1.0;
        difference -= side * density(at + side);
    }
    return turned(grid.rotation, difference / grid.spacing);
}

struct Ray {
    origin: vec3f,
    // A voxel long.
    direction: vec3f,
    inverse: vec3f,
}

// From where to where a ray is between two corners.
fn crossing(ray: Ray, low: vec3f, high: vec3f) -> vec2f {
    let a = (low - ray.origin) * ray.inverse;
    let b = (high - ray.origin) * ray.inverse;
    let near = min(a, b);
    let far = max(a, b);
    return vec2f(max(near.x, max(near.y, near.z)), min(far.x, min(far.y, far.z)));
}

// Where a ray meets the surface, which is between two of its places.
fn refined(ray: Ray, first: f32, last: f32) -> f32 {
    var before = first;
    var behind = last;
    for (var k = 0; k < 5; k++) {
        let middle = 0.5 * (before + behind);
        if density(ray.origin + ray.direction * middle) < SURFACE {
            before = middle;
        } else {
            behind = middle;
        }
    }
    return 0.5 * (before + behind);
}

// Where a ray first meets the surface before `last`: 0 if it begins inside, −1 if nowhere.
fn march(ray: Ray, last: f32, step: f32) -> f32 {
    let last_cell = vec3f(textureDimensions(peaks)) - 1.0;
    var at = 0.0;
    var before = 0.0;
    while at < last {
        let place = ray.origin + ray.direction * at;
        let cell = clamp(floor((place - 0.5) / grid.cell), vec3f(0.0), last_cell);
        // Beyond the outer voxels' middles, nothing new is interpolated.
        let low = select(cell * grid.cell + 0.5, vec3f(-1e5), cell == vec3f(0.0));
        let high = select((cell + 1.0) * grid.cell + 0.5, vec3f(1e5), cell == last_cell);
        let end = min(crossing(ray, low, high).y, last);
        if textureLoad(peaks, vec3i(cell), 0).r < SURFACE {
            before = max(end, at);
            at = before + 0.01;
            continue;
        }
        // At least one step, so that every turn of the loop leads on.
        loop {
            if density(ray.origin + ray.direction * at) >= SURFACE {
                if at > 0.0 {
                    return refined(ray, before, at);
                }
                return 0.0;
            }
            before = at;
            at += step;
            if at >= end {
                break;
            }
        }
    }
    return -1.0;
}

struct Side {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
}

// A corner of the box's sides, in the world.
fn corner(index: u32) -> vec3f {
    return turned(grid.rotation, corner_of_box(index).share * sides() * grid.spacing) + grid.place;
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Side {
    let position = corner(index);
    return Side(globals.view_projection * vec4f(position, 1.0), position);
}

@vertex
fn caster_vertex(@builtin(vertex_index) index: u32) -> Side {
    let position = corner(index);
    return Side(globals.light_projection * vec4f(position, 1.0), position);
}

struct Hit {
    position: vec3f,
    // In voxels.
    place: vec3f,
    // Whether it is where the ray entered the box.
    on_side: bool,
    is_some: bool,
}

// What is met on the way to `position`, from `way` before it, in steps of so many voxels; nothing nearer
// than `nearest` of the way.
fn met(position: vec3f, way: vec3f, nearest: f32, step: f32) -> Hit {
    let whole = along_voxels(way);
    let voxels = length(whole);
    let direction = whole / voxels;
    // A way along an axis is taken as almost along it.
    let inverse = 1.0 / select(direction, vec3f(1e-9), abs(direction) < vec3f(1e-9));
    let end = in_voxels(position);
    let within = crossing(Ray(end, direction, inverse), vec3f(0.0), sides());
    // Ways are counted from the entry: from an eye far away, a step would be lost in rounding.
    let entry = max(within.x, (nearest - 1.0) * voxels);
    let ray = Ray(end + direction * entry, direction, inverse);
    let at = march(ray, -entry, step);
    let back = (entry + at) / voxels;
    return Hit(position + way * back, ray.origin + direction * at, at == 0.0, at >= 0.0);
}

struct Pixel {
    @location(0) color: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(side: Side) -> Pixel {
    let way = side.position - globals.eye;
    // The picture begins at a depth of 1, and depth is in inverse proportion to the way.
    let nearest = side.clip.z;
    let hit = met(side.position, way, nearest, grid.step);
    if !hit.is_some {
        discard;
    }
    var normal = outward(hit.place);
    if hit.on_side || dot(normal, normal) == 0.0 {
        // A flat cut: by a side of the box, or by the nearest depth that is seen.
        let to_middle = abs(hit.place / sides() - 0.5);
        let most = max(to_middle.x, max(to_middle.y, to_middle.z));
        let toward = select(vec3f(0.0), sign(hit.place / sides() - 0.5), to_middle == vec3f(most));
        normal = select(-way, turned(grid.rotation, toward), most > 0.4999);
    }
    normal = normalize(normal);
    // The colour is that of what lies half a millimetre below.
    let below = density(hit.place - along_voxels(normal * 5e-4));
    let albedo = mix(MARROW, grid.color.rgb, smoothstep(0.25, 0.8, below));
    let clip = globals.view_projection * vec4f(hit.position, 1.0);
    return Pixel(vec4f(shade(hit.position, normal, albedo, 0.5), 1.0), clip.z / clip.w);
}

@fragment
fn caster(side: Side) -> @builtin(frag_depth) f32 {
    // As far back as the box may reach.
    let reach = length(sides() * grid.spacing);
    // A shadow need not be as exact as what casts it.
    let hit = met(side.position, -globals.light * reach, 0.0, 2.0 * grid.step);
    if !hit.is_some {
        discard;
    }
    // A voxel further, so that the surface does not shade itself.
    let voxel = max(grid.spacing.x, max(grid.spacing.y, grid.spacing.z));
    return (globals.light_projection * vec4f(hit.position - globals.light * voxel, 1.0)).z;
}
