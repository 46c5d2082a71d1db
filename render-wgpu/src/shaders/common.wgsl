// What every shader shares: the frame's numbers, the light and the colours.

struct Globals {
    view_projection: mat4x4f,
    light_projection: mat4x4f,
    eye: vec3f,
    // 0: object, 1: strain, 2: speed.
    coloring: u32,
    // Towards the light, of unit length.
    light: vec3f,
    // 0: fast, 1: fine.
    quality: u32,
    room_min: vec3f,
    has_room: u32,
    room_max: vec3f,
    // The width of the shadow map's pixels at its distance, in metres.
    shadow_texel: f32,
}

@group(0) @binding(0) var<uniform> globals: Globals;
@group(0) @binding(1) var shadow_map: texture_depth_2d;
@group(0) @binding(2) var shadow_sampler: sampler_comparison;

const SUN = vec3f(2.3, 2.15, 1.9);
const SKY = vec3f(0.52, 0.62, 0.78);
const GROUND = vec3f(0.30, 0.26, 0.23);

// What is farther from the light than the map reaches is in the shadow of what is in the map, and not of nothing.
fn lit_at(uv: vec2f, depth: f32) -> f32 {
    return textureSampleCompareLevel(shadow_map, shadow_sampler, uv, min(depth, 1.0));
}

// How much of the light reaches a place, and how much of the sky seems to.
fn shadow(position: vec3f, normal: vec3f) -> vec2f {
    // Moved off the surface by more than a pixel of the map, so that it does not shade itself.
    let off = position + normal * (1.5 * globals.shadow_texel);
    let clip = globals.light_projection * vec4f(off, 1.0);
    let uv = clip.xy * vec2f(0.5, -0.5) + 0.5;
    if any(uv < vec2f(0.0)) || any(uv > vec2f(1.0)) {
        return vec2f(1.0);
    }
    if globals.quality == 0u {
        let lit = lit_at(uv, clip.z);
        return vec2f(lit, 0.55 + 0.45 * lit);
    }
    let texel = 1.0 / f32(textureDimensions(shadow_map).x);
    var near = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            near += lit_at(uv + vec2f(f32(x), f32(y)) * 1.4 * texel, clip.z);
        }
    }
    // A wide look around stands for the part of the sky that neighbours hide.
    var wide = 0.0;
    for (var k = 0; k < 12; k++) {
        // The golden angle spreads the samples evenly over the disc.
        let angle = 2.399963 * f32(k);
        let radius = 22.0 * texel * sqrt((f32(k) + 0.5) / 12.0);
        wide += lit_at(uv + vec2f(cos(angle), sin(angle)) * radius, clip.z);
    }
    return vec2f(near / 9.0, 0.4 + 0.6 * wide / 12.0);
}

// How much of the sky the room's walls leave to a place near them.
fn openness(position: vec3f, normal: vec3f) -> f32 {
    if globals.has_room == 0u {
        return 1.0;
    }
    let to_min = position - globals.room_min;
    let to_max = globals.room_max - position;
    // A wall that the surface itself is part of, or turned away from, takes nothing.
    let low = exp(-5.0 * max(to_min, vec3f(0.0))) * clamp(0.8 - normal, vec3f(0.0), vec3f(1.0));
    let high = exp(-5.0 * max(to_max, vec3f(0.0))) * clamp(0.8 + normal, vec3f(0.0), vec3f(1.0));
    let open = (1.0 - 0.4 * low) * (1.0 - 0.4 * high);
    return open.x * open.y * open.z;
}

// From light of any strength to what a screen shows (K. Narkowicz's fit of the ACES curve).
fn tone(color: vec3f) -> vec3f {
    let mapped = color * (2.51 * color + 0.03) / (color * (2.43 * color + 0.59) + 0.14);
    return clamp(mapped, vec3f(0.0), vec3f(1.0));
}

fn shade(position: vec3f, normal: vec3f, albedo: vec3f, gloss: f32) -> vec3f {
    let view = normalize(globals.eye - position);
    let facing = max(dot(normal, globals.light), 0.0);
    let reach = shadow(position, normal);
    let sky = mix(GROUND, SKY, 0.5 + 0.5 * normal.y) * openness(position, normal) * reach.y;
    let halfway = normalize(globals.light + view);
    let glint = pow(max(dot(normal, halfway), 0.0), 60.0) * gloss;
    let rim = pow(1.0 - max(dot(normal, view), 0.0), 4.0) * gloss;
    let direct = SUN * facing * reach.x;
    return tone(0.62 * (albedo * (sky + direct * 0.62) + direct * glint + sky * rim));
}

struct BoxCorner {
    // From 0 to 1 along each axis.
    share: vec3f,
    // Of its side, inwards.
    normal: vec3f,
}

// A corner of the sides of a box, which are counter-clockwise as seen from inside.
fn corner_of_box(index: u32) -> BoxCorner {
    // Six sides of six corners: axis and sign of the side, then the corner on it.
    let side = index / 6u;
    let axis = side / 2u;
    let high = side % 2u == 1u;
    var corners = array(vec2f(0.0, 0.0), vec2f(1.0, 0.0), vec2f(1.0, 1.0),
                        vec2f(0.0, 0.0), vec2f(1.0, 1.0), vec2f(0.0, 1.0));
    var corner = corners[index % 6u];
    if high {
        corner = corner.yx;
    }
    var share = vec3f(0.0);
    share[axis] = select(0.0, 1.0, high);
    share[(axis + 1u) % 3u] = corner.x;
    share[(axis + 2u) % 3u] = corner.y;
    var normal = vec3f(0.0);
    normal[axis] = select(1.0, -1.0, high);
    return BoxCorner(share, normal);
}

// A vector turned by a quaternion.
fn turned(rotation: vec4f, v: vec3f) -> vec3f {
    return v + 2.0 * cross(rotation.xyz, cross(rotation.xyz, v) + rotation.w * v);
}
