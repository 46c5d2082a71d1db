// Objects by their numbers, for one pixel.

struct Pickable {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) object: u32,
}

@vertex
fn pick_vertex(body: Instance, @builtin(vertex_index) node: u32) -> Pickable {
    return Pickable(globals.view_projection * vec4f(place_of(body, node), 1.0), body.object);
}

@fragment
fn pick_fragment(picked: Pickable) -> @location(0) vec2u {
    return vec2u(picked.object + 1u, bitcast<u32>(picked.clip.z));
}
