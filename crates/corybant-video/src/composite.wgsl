// Draws the picture of the dancers over the background. The picture has SAMPLES samples for each pixel, multiplied by alpha. `pipelines.rs` adds
// the constant SAMPLES.

@group(0) @binding(0) var dancers: texture_multisampled_2d<f32>;

// A triangle that covers the frame.
@vertex
fn composite_vertex(@builtin(vertex_index) n: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32((n << 1u) & 2u), f32(n & 2u)) * 2.0 - 1.0, 0.0, 1.0);
}

// Mean of the samples of a pixel, for smooth edges.
@fragment
fn composite_fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    var sum = vec4f(0.0);
    for (var n = 0; n < SAMPLES; n++) {
        sum += textureLoad(dancers, vec2i(at.xy), n);
    }
    return sum / f32(SAMPLES);
}
