// Objects by their numbers, for one pixel.

struct Pickable {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) object: u32,
    // Of the triangle's first corner.
    @location(1) @interpolate(flat) node: u32,
}

@vertex
fn pick_vertex(body: Instance, @builtin(vertex_index) node: u32) -> Pickable {
    let clip = globals.view_projection * vec4f(place_of(body, node), 1.0);
    return Pickable(clip, body.object, node);
}

@fragment
fn pick_fragment(picked: Pickable) -> @location(0) vec4u {
    return vec4u(picked.object + 1u, picked.node, bitcast<u32>(picked.clip.z), 0u);
}
