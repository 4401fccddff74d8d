// Light that arrives at a point straight from a punctual light, shadows aside. Twin of light.py.
// Source: glTF extension KHR_lights_punctual.
// include optics/records.wgsl

struct Arriving {
    irradiance: vec3f,     // lx on a surface that faces the light
    distance: f32,         // m, 3.4e38 for a directional light
    wi: vec3f,             // towards the light, unit
}

const FAR = 3.4e38;

fn light_arriving(light: Light, position: vec3f) -> Arriving {
    if (light.kind == LIGHT_DIRECTIONAL) {
        return Arriving(light.intensity, FAR, -light.direction);
    }
    let to_light = light.position - position;
    let square = max(dot(to_light, to_light), 1e-30);
    let distance = sqrt(square);
    let wi = to_light / distance;
    let kept = range_window(distance, light.range) * cone_falloff(light, -wi);
    return Arriving(light.intensity * (kept / square), distance, wi);
}

// 1 to 0 at the light's range.
fn range_window(distance: f32, range: f32) -> f32 {
    let x = distance / range;
    return select(1.0, clamp(1.0 - x * x * x * x, 0.0, 1.0), range > 0.0);
}

// Share of its intensity that a light sends along `d`, unit: 1 but for spots.
fn cone_falloff(light: Light, d: vec3f) -> f32 {
    let edge = clamp(dot(light.direction, d) * light.cone_scale + light.cone_offset, 0.0, 1.0);
    return edge * edge;
}
