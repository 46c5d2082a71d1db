// A whole frame of one mass–spring body, by one workgroup: the law and the order of `sim`'s
// `spring_kernel`, except that sums over all nodes are taken in another order.

struct Numbers {
    // In metres per second squared.
    gravity: vec3f,
    nodes: u32,
    // In newtons per metre, and newton seconds per metre.
    stiffness: f32,
    center_stiffness: f32,
    damping: f32,
    // The frame's time and a substep's, in seconds.
    time: f32,
    step_time: f32,
    substeps: u32,
    has_center: u32,
}

// A dashpot acts instead of a spring where the flag is set.
struct Step {
    from_state: u32,
    to_state: u32,
    time: f32,
    dashpots: bool,
}

const LANES: u32 = 256u;
// As in `spring_law.rs`.
const LEAST_SQUARE: f32 = 1e-30;

// Where the neighbours of each node begin, and after all where they end; then for each neighbour its
// number and the spring's length at rest; then each node's distance to the centre at rest.
@group(0) @binding(0) var<storage, read> table: array<u32>;
// Not a uniform: for those Mesa's software adapter compiles the loops anew in every dispatch.
@group(0) @binding(1) var<storage, read> numbers: Numbers;
// Positions, velocities, masses; then positions and velocities once more: what one step writes, the
// next one reads. Components x, y and z lie one after the other.
@group(0) @binding(2) var<storage, read_write> state: array<f32>;

var<workgroup> partial: array<vec3f, LANES>;

fn vector(begin: u32, node: u32) -> vec3f {
    let n = numbers.nodes;
    return vec3f(state[begin + node], state[begin + n + node], state[begin + 2u * n + node]);
}

fn set_vector(begin: u32, node: u32, value: vec3f) {
    let n = numbers.nodes;
    state[begin + node] = value.x;
    state[begin + n + node] = value.y;
    state[begin + 2u * n + node] = value.z;
}

// In newtons per metre of the way.
fn pull(dashpots: bool, way: vec3f, relative: vec3f, stiffness: f32, rest: f32) -> f32 {
    let square = dot(way, way) + LEAST_SQUARE;
    if dashpots {
        return numbers.damping * dot(way, relative) / square;
    }
    return stiffness * (1.0 - rest / sqrt(square));
}

// The sum of what the lanes have, for those that have a node.
fn total(own: vec3f, lane: u32) -> vec3f {
    // Somebody may still be reading the last one.
    workgroupBarrier();
    partial[lane] = own;
    workgroupBarrier();
    var sum = vec3f(0.0);
    if lane < numbers.nodes {
        for (var other = 0u; other < min(LANES, numbers.nodes); other += 1u) {
            sum += partial[other];
        }
    }
    return sum;
}

fn mean(begin: u32, lane: u32) -> vec3f {
    var sum = vec3f(0.0);
    for (var node = lane; node < numbers.nodes; node += LANES) {
        sum += vector(begin, node);
    }
    return total(sum, lane) / f32(numbers.nodes);
}

// The force of a node's spring to the centre, of which place and velocity are given.
fn center_force(step: Step, node: u32, center: vec3f, center_velocity: vec3f) -> vec3f {
    let n = numbers.nodes;
    let way = center - vector(step.from_state, node);
    let relative = center_velocity - vector(step.from_state + 3u * n, node);
    let rest = bitcast<f32>(table[table[n] + node]);
    return way * pull(step.dashpots, way, relative, numbers.center_stiffness, rest);
}

// The force of a node's springs to its neighbours.
fn edge_force(step: Step, node: u32) -> vec3f {
    let velocities = step.from_state + 3u * numbers.nodes;
    let position = vector(step.from_state, node);
    let velocity = vector(velocities, node);
    var force = vec3f(0.0);
    for (var entry = table[node]; entry < table[node + 1u]; entry += 2u) {
        let neighbour = table[entry];
        let way = vector(step.from_state, neighbour) - position;
        let relative = vector(velocities, neighbour) - velocity;
        let rest = bitcast<f32>(table[entry + 1u]);
        force += way * pull(step.dashpots, way, relative, numbers.stiffness, rest);
    }
    return force;
}

fn advance(step: Step, lane: u32) {
    let n = numbers.nodes;
    var center = vec3f(0.0);
    var center_velocity = vec3f(0.0);
    var shared_force = vec3f(0.0);
    if numbers.has_center != 0u {
        center = mean(step.from_state, lane);
        if step.dashpots {
            center_velocity = mean(step.from_state + 3u * n, lane);
        }
        var sum = vec3f(0.0);
        for (var node = lane; node < n; node += LANES) {
            sum += center_force(step, node, center, center_velocity);
        }
        shared_force = total(sum, lane) / -f32(n);
    }
    for (var node = lane; node < n; node += LANES) {
        let mass = state[6u * n + node];
        var force = edge_force(step, node) + shared_force;
        if numbers.has_center != 0u {
            force += center_force(step, node, center, center_velocity);
        }
        if !step.dashpots {
            force += numbers.gravity * mass;
        }
        // A node without mass is held fast.
        let inverse_mass = select(0.0, 1.0 / mass, mass > 0.0);
        let position = vector(step.from_state, node);
        let velocity =
            vector(step.from_state + 3u * n, node) + force * (inverse_mass * step.time);
        let drift = select(velocity * step.time, vec3f(0.0), step.dashpots);
        set_vector(step.to_state, node, position + drift);
        set_vector(step.to_state + 3u * n, node, velocity);
    }
    storageBarrier();
}

@compute @workgroup_size(LANES)
fn advance_frame(@builtin(local_invocation_index) lane: u32) {
    var from_state = 0u;
    var to_state = 7u * numbers.nodes;
    if numbers.damping > 0.0 {
        advance(Step(from_state, to_state, numbers.time, true), lane);
        from_state = to_state;
        to_state = 0u;
    }
    for (var done = 0u; done < numbers.substeps; done += 1u) {
        advance(Step(from_state, to_state, numbers.step_time, false), lane);
        let written = to_state;
        to_state = from_state;
        from_state = written;
    }
}
