// Surfaces: every vertex is fetched by its node's number, its normal made from its neighbours.

struct Instance {
    // Where and how the body is turned: rotation as a quaternion, then the place.
    @location(0) rotation: vec4f,
    @location(1) place: vec3f,
    // The first of its numbers.
    @location(2) first: u32,
    @location(3) color: vec4f,
    // Its number of nodes.
    @location(4) nodes: u32,
    @location(5) object: u32,
    // Of the body as a whole, in m/s; nodes may have more of their own.
    @location(6) velocity: vec3f,
}

// For each body the nodes' x, then y, then z; if colours say the speed, their own velocities likewise, as far as
// they have any.
@group(1) @binding(0) var<storage, read> numbers: array<f32>;
// For each node where its ring begins; a ring has for each triangle at the node the two other nodes,
// and the distance to the first of them at rest, or 0 if no spring leads there.
@group(2) @binding(0) var<storage, read> rings: array<u32>;

struct Vertex {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) color: vec3f,
}

fn vector(body: Instance, list: u32, node: u32) -> vec3f {
    let at = body.first + 3u * body.nodes * list + node;
    return vec3f(numbers[at], numbers[at + body.nodes], numbers[at + 2u * body.nodes]);
}

fn place_of(body: Instance, node: u32) -> vec3f {
    return turned(body.rotation, vector(body, 0u, node)) + body.place;
}

// Blue for −0.2, grey for 0, red for 0.2.
fn strain_color(strain: f32) -> vec3f {
    let share = clamp(strain * 5.0, -1.0, 1.0);
    let end = select(vec3f(0.05, 0.2, 0.9), vec3f(0.9, 0.08, 0.05), share > 0.0);
    return mix(vec3f(0.7), end, abs(share));
}

// From nearly black for rest over red and yellow to white for 3 m/s.
fn speed_color(speed: f32) -> vec3f {
    let share = clamp(speed / 3.0, 0.0, 1.0);
    return clamp(vec3f(0.05) + share * vec3f(3.0) - vec3f(0.0, 1.0, 2.0), vec3f(0.02), vec3f(1.0));
}

@vertex
fn vertex(body: Instance, @builtin(vertex_index) node: u32) -> Vertex {
    let own = vector(body, 0u, node);
    // The sum over the triangles around is the mean of their normals, weighted by area.
    var normal = vec3f(0.0);
    var strain = 0.0;
    var springs = 0.0;
    for (var k = rings[node]; k < rings[node + 1u]; k += 3u) {
        let a = vector(body, 0u, rings[k]) - own;
        let b = vector(body, 0u, rings[k + 1u]) - own;
        normal += cross(a, b);
        let rest = bitcast<f32>(rings[k + 2u]);
        if globals.coloring == 1u && rest > 0.0 {
            strain += length(a) / rest - 1.0;
            springs += 1.0;
        }
    }
    var color = body.color.rgb;
    if globals.coloring == 1u && springs > 0.0 {
        color = strain_color(strain / springs);
    } else if globals.coloring == 2u {
        color = speed_color(length(body.velocity + vector(body, 1u, node)));
    }
    let position = turned(body.rotation, own) + body.place;
    let clip = globals.view_projection * vec4f(position, 1.0);
    return Vertex(clip, position, turned(body.rotation, normal), color);
}

@fragment
fn fragment(vertex: Vertex, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let outward = normalize(vertex.normal);
    let normal = select(-outward, outward, front);
    return vec4f(shade(vertex.position, normal, vertex.color, 0.5), 1.0);
}

// An edge is lit alike from all sides.
@fragment
fn edge(vertex: Vertex) -> @location(0) vec4f {
    return vec4f(tone(vertex.color), 1.0);
}

@vertex
fn caster(body: Instance, @builtin(vertex_index) node: u32) -> @builtin(position) vec4f {
    return globals.light_projection * vec4f(place_of(body, node), 1.0);
}
