//! The GPU pipelines: shader, layouts and render states.
//!
//! In: a device.
//! Out: the pipelines that a canvas uses.
//! Thread: any except show and audio.
//! Allocates: freely.

use std::num::NonZeroU64;

use wgpu::{
    BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, BlendComponent,
    BlendFactor, BlendOperation, BlendState, BufferBindingType, ColorTargetState, CompareFunction,
    DepthBiasState, DepthStencilState, Device, Face, FragmentState, MultisampleState,
    PipelineLayout, PipelineLayoutDescriptor, PrimitiveState, RenderPipeline,
    RenderPipelineDescriptor, SamplerBindingType, ShaderModule, ShaderModuleDescriptor,
    ShaderSource, ShaderStages, StencilState, TextureFormat, TextureSampleType,
    TextureViewDimension, VertexAttribute, VertexBufferLayout, VertexState, VertexStepMode,
    vertex_attr_array,
};

use crate::avatar::FLOATS_PER_VERTEX;
use crate::avatar_meshes::Layer;
use crate::figure::FLOATS_PER_LIMB;
use crate::scene::SCENE_FLOATS;

/// The texture format of pictures: red, green, blue and an unused byte for each pixel.
pub const COLOUR: TextureFormat = TextureFormat::Rgba8Unorm;
/// The texture format of the depth buffers and the shadow map: a 32-bit float.
pub const DEPTH: TextureFormat = TextureFormat::Depth32Float;
/// Number of samples that are drawn for each pixel of the dancers and then averaged, for smooth
/// edges (anti-aliasing). The stage has soft edges and needs one sample.
pub const SAMPLES: u32 = 4;
/// Offset that is added to the depths in the shadow map: a constant part, and a part proportional
/// to the slope of the surface. It prevents surfaces from casting shadows on themselves.
const BIAS: DepthBiasState = DepthBiasState {
    constant: 2,
    slope_scale: 2.0,
    clamp: 0.0,
};

/// Adds light to a picture so that the sum is never brighter than 1 ("screen").
const SCREEN: BlendState = BlendState {
    color: BlendComponent {
        src_factor: BlendFactor::One,
        dst_factor: BlendFactor::OneMinusSrc,
        operation: BlendOperation::Add,
    },
    alpha: BlendComponent::OVER,
};

/// The vertex of the unit mesh of a limb.
const MESH: [VertexAttribute; 1] = vertex_attr_array![0 => Float32x4];
/// A segment of a limb.
const PIECE: [VertexAttribute; FLOATS_PER_LIMB / 4] = vertex_attr_array![
    1 => Float32x4, 2 => Float32x4, 3 => Float32x4, 4 => Float32x4, 5 => Float32x4, 6 => Float32x4,
    7 => Float32x4,
];
/// Position and normal of a skinned vertex of an avatar, and its coordinates in the picture.
const SKINNED: [VertexAttribute; 2] = vertex_attr_array![0 => Float32x3, 1 => Float32x3];
const UV: [VertexAttribute; 1] = vertex_attr_array![2 => Float32x2];

/// The GPU pipelines for all parts of a picture, and the layouts of their resources.
pub struct Pipelines {
    pub shadow: RenderPipeline,
    pub body: RenderPipeline,
    pub floor: RenderPipeline,
    /// The pipeline that draws the part of the floor around the dancers, which can have shadows.
    pub near: RenderPipeline,
    pub backdrop: RenderPipeline,
    /// The pipeline that adds the light of the beams to the background.
    pub beams: RenderPipeline,
    /// The pipeline that draws the dancers over the background.
    pub composite: RenderPipeline,
    pub avatars: AvatarPipelines,
    /// The layout of the bind group (set of shader resources) that contains the numbers of a scene.
    pub scene: BindGroupLayout,
    /// The layout of the bind group (set of shader resources) that contains the shadow map.
    pub shadows: BindGroupLayout,
    /// The layout of the bind group (set of shader resources) that contains the picture of the
    /// dancers.
    pub dancers: BindGroupLayout,
}

/// The GPU pipelines for avatars.
pub struct AvatarPipelines {
    pub shadow: RenderPipeline,
    /// For each layer, the pipelines for triangles that are seen from one side and from both sides.
    bodies: [[RenderPipeline; 2]; 2],
    /// The layout of the bind group of a material: numbers, picture and sampler.
    pub material: BindGroupLayout,
}

impl AvatarPipelines {
    fn new(
        device: &Device,
        shader: &ShaderModule,
        scene: &BindGroupLayout,
        shadows: &BindGroupLayout,
    ) -> Self {
        let material = material_layout(device);
        let layout = |groups: &[Option<&BindGroupLayout>]| layout_of(device, groups);
        let all = layout(&[Some(scene), Some(shadows), Some(&material)]);
        let shadow = Kind {
            vertex: "avatar_shadow_vertex",
            fragment: None,
            vertices: Vertices::Avatar,
            cull: None,
            blend: None,
            bias: BIAS,
            samples: 1,
        };
        let bodies = |layer| {
            [Some(Face::Back), None].map(|cull| {
                let kind = Kind {
                    cull,
                    blend: (layer == Layer::Blended).then_some(BlendState::ALPHA_BLENDING),
                    ..seen("avatar_vertex", "avatar_fragment", Vertices::Avatar)
                };
                pipeline(device, shader, &all, &kind)
            })
        };
        Self {
            shadow: pipeline(device, shader, &layout(&[Some(scene)]), &shadow),
            bodies: [Layer::Solid, Layer::Blended].map(bodies),
            material,
        }
    }

    /// Returns the pipeline for the parts in `layer`.
    pub fn body(&self, layer: Layer, is_double_sided: bool) -> &RenderPipeline {
        &self.bodies[layer as usize][usize::from(is_double_sided)]
    }
}

/// What the vertices of a pipeline are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Vertices {
    /// None: the shader computes them.
    None,
    /// The unit mesh, once for each segment of a limb.
    Pieces,
    /// Skinned vertices of an avatar.
    Avatar,
}

/// The parameters in which the GPU pipelines differ from each other.
struct Kind<'a> {
    vertex: &'a str,
    /// Name of the fragment shader's function; `None` if the pipeline draws only depth.
    fragment: Option<&'a str>,
    vertices: Vertices,
    cull: Option<Face>,
    blend: Option<BlendState>,
    bias: DepthBiasState,
    samples: u32,
}

impl Pipelines {
    /// Compiles the shader and creates all pipelines on the GPU `device`.
    pub fn new(device: &Device) -> Self {
        let shader = device.create_shader_module(ShaderModuleDescriptor {
            label: None,
            source: ShaderSource::Wgsl(
                concat!(include_str!("film.wgsl"), include_str!("avatar.wgsl")).into(),
            ),
        });
        let scene = scene_layout(device);
        let shadows = shadows_layout(device);
        let layout = |groups: &[Option<&BindGroupLayout>]| layout_of(device, groups);
        let (alone, both) = (
            layout(&[Some(&scene)]),
            layout(&[Some(&scene), Some(&shadows)]),
        );
        let shadow = Kind {
            vertex: "shadow_vertex",
            fragment: None,
            vertices: Vertices::Pieces,
            cull: Some(Face::Back),
            blend: None,
            bias: BIAS,
            samples: 1,
        };
        let stage = |fragment| Kind {
            samples: 1,
            ..seen("far_vertex", fragment, Vertices::None)
        };
        let beams = Kind {
            vertex: "beam_vertex",
            blend: Some(SCREEN),
            ..stage("beam_fragment")
        };
        let composite = Kind {
            vertex: "composite_vertex",
            blend: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            ..stage("composite_fragment")
        };
        let dancers = dancers_layout(device);
        let samples = format!("const SAMPLES: i32 = {SAMPLES};\n");
        let over = device.create_shader_module(ShaderModuleDescriptor {
            label: None,
            source: ShaderSource::Wgsl((samples + include_str!("composite.wgsl")).into()),
        });
        let make = |layout: &PipelineLayout, kind: &Kind| pipeline(device, &shader, layout, kind);
        Self {
            shadow: make(&alone, &shadow),
            body: make(
                &both,
                &seen("body_vertex", "body_fragment", Vertices::Pieces),
            ),
            floor: make(&both, &stage("floor_fragment")),
            near: make(&both, &stage("near_fragment")),
            backdrop: make(&both, &stage("backdrop_fragment")),
            beams: make(&both, &beams),
            composite: pipeline(device, &over, &layout(&[Some(&dancers)]), &composite),
            avatars: AvatarPipelines::new(device, &shader, &scene, &shadows),
            scene,
            shadows,
            dancers,
        }
    }
}

fn scene_layout(device: &Device) -> BindGroupLayout {
    let size = NonZeroU64::new(4 * SCENE_FLOATS as u64);
    let ty = BindingType::Buffer {
        ty: BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: size,
    };
    let entries = [BindGroupLayoutEntry {
        binding: 0,
        visibility: ShaderStages::VERTEX_FRAGMENT,
        ty,
        count: None,
    }];
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

fn shadows_layout(device: &Device) -> BindGroupLayout {
    let map = BindingType::Texture {
        sample_type: TextureSampleType::Depth,
        view_dimension: TextureViewDimension::D2,
        multisampled: false,
    };
    let sampler = BindingType::Sampler(SamplerBindingType::Comparison);
    let entry = |binding, ty| BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::FRAGMENT,
        ty,
        count: None,
    };
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: None,
        entries: &[entry(0, map), entry(1, sampler)],
    })
}

fn dancers_layout(device: &Device) -> BindGroupLayout {
    let picture = BindingType::Texture {
        sample_type: TextureSampleType::Float { filterable: false },
        view_dimension: TextureViewDimension::D2,
        multisampled: true,
    };
    let entries = [BindGroupLayoutEntry {
        binding: 0,
        visibility: ShaderStages::FRAGMENT,
        ty: picture,
        count: None,
    }];
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

fn material_layout(device: &Device) -> BindGroupLayout {
    let entry = |binding, ty| BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::FRAGMENT,
        ty,
        count: None,
    };
    let numbers = BindingType::Buffer {
        ty: BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let picture = BindingType::Texture {
        sample_type: TextureSampleType::Float { filterable: true },
        view_dimension: TextureViewDimension::D2,
        multisampled: false,
    };
    let sampler = BindingType::Sampler(SamplerBindingType::Filtering);
    let entries = [entry(0, numbers), entry(1, picture), entry(2, sampler)];
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

/// Returns the parameters of a pipeline that draws into the picture.
fn seen<'a>(vertex: &'a str, fragment: &'a str, vertices: Vertices) -> Kind<'a> {
    Kind {
        vertex,
        fragment: Some(fragment),
        vertices,
        cull: (vertices == Vertices::Pieces).then_some(Face::Back),
        blend: None,
        bias: DepthBiasState::default(),
        samples: SAMPLES,
    }
}

fn layout_of(device: &Device, groups: &[Option<&BindGroupLayout>]) -> PipelineLayout {
    device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: groups,
        immediate_size: 0,
    })
}

/// Returns the layouts of the vertex buffers of a pipeline.
fn buffers(vertices: Vertices) -> Vec<Option<VertexBufferLayout<'static>>> {
    let layout = |floats: usize, step_mode, attributes| {
        Some(VertexBufferLayout {
            array_stride: 4 * floats as u64,
            step_mode,
            attributes,
        })
    };
    match vertices {
        Vertices::None => Vec::new(),
        Vertices::Pieces => vec![
            layout(4, VertexStepMode::Vertex, &MESH),
            layout(FLOATS_PER_LIMB, VertexStepMode::Instance, &PIECE),
        ],
        Vertices::Avatar => vec![
            layout(FLOATS_PER_VERTEX, VertexStepMode::Vertex, &SKINNED),
            layout(2, VertexStepMode::Vertex, &UV),
        ],
    }
}

fn pipeline(
    device: &Device,
    shader: &ShaderModule,
    layout: &PipelineLayout,
    kind: &Kind,
) -> RenderPipeline {
    let has_depth = kind.vertices != Vertices::None;
    let target = [Some(ColorTargetState {
        blend: kind.blend,
        ..ColorTargetState::from(COLOUR)
    })];
    let fragment = |entry| FragmentState {
        module: shader,
        entry_point: Some(entry),
        compilation_options: Default::default(),
        targets: &target,
    };
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some(kind.vertex),
        layout: Some(layout),
        vertex: VertexState {
            module: shader,
            entry_point: Some(kind.vertex),
            compilation_options: Default::default(),
            buffers: &buffers(kind.vertices),
        },
        primitive: PrimitiveState {
            cull_mode: kind.cull,
            ..Default::default()
        },
        // The background and the composite have no depth.
        depth_stencil: has_depth.then(|| DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(kind.blend.is_none()),
            depth_compare: Some(CompareFunction::LessEqual),
            stencil: StencilState::default(),
            bias: kind.bias,
        }),
        multisample: MultisampleState {
            count: kind.samples,
            ..Default::default()
        },
        fragment: kind.fragment.map(fragment),
        multiview_mask: None,
        cache: None,
    })
}
