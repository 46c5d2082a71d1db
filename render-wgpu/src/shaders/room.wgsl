// The room: the inner sides of a box, of which those turned to the viewer are drawn.

struct Wall {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) @interpolate(flat) normal: vec3f,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Wall {
    let corner = corner_of_box(index);
    let position = mix(globals.room_min, globals.room_max, corner.share);
    return Wall(globals.view_projection * vec4f(position, 1.0), position, corner.normal);
}

// How much a line of a grid of half a metre covers of a pixel.
fn line(coordinate: f32) -> f32 {
    let scaled = coordinate * 2.0;
    let width = fwidth(scaled);
    let away = abs(fract(scaled - 0.5) - 0.5);
    // Where the grid is finer than pixels, it fades into the mean.
    return clamp(1.2 - away / max(width, 1e-6), 0.0, 1.0) * clamp(0.35 / max(width, 1e-6), 0.0, 1.0);
}

@fragment
fn fragment(wall: Wall) -> @location(0) vec4f {
    let from_corner = wall.position - globals.room_min;
    let lines = vec3f(line(from_corner.x), line(from_corner.y), line(from_corner.z))
        * (1.0 - abs(wall.normal));
    let floor = wall.normal.y > 0.5;
    let base = select(vec3f(0.50, 0.53, 0.58), vec3f(0.56, 0.53, 0.49), floor);
    let albedo = base * (1.0 - 0.16 * max(lines.x, max(lines.y, lines.z)));
    return vec4f(shade(wall.position, wall.normal, albedo, 0.06), 1.0);
}
