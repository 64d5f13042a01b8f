//! The avatars of a video on the GPU.
//!
//! In: avatars; their skinned vertices in each picture.
//! Out: draw commands.
//! Thread: any except show and audio.
//! Allocates: once for each avatar.

use wgpu::{
    AddressMode, BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer,
    BufferUsages, Device, FilterMode, IndexFormat, MipmapFilterMode, Origin3d, Queue, RenderPass,
    Sampler, SamplerDescriptor, TexelCopyBufferLayout, TexelCopyTextureInfo, TextureAspect,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};

use crate::avatar::{Avatar, FLOATS_PER_VERTEX, Material, Picture, Transparency};
use crate::gpu::{buffer, extent, view};
use crate::pipelines::Pipelines;

/// The format of the pictures of materials.
const FORMAT: TextureFormat = TextureFormat::Rgba8UnormSrgb;
/// Value of `cutoff` in the shader with which no pixel is left out.
const OPAQUE_CUTOFF: f32 = -1.0;

/// The parts of an avatar that are drawn in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Opaque parts and parts with holes, before the background.
    Solid,
    /// Parts that let the background through, after it.
    Blended,
}

/// An avatar on the GPU.
pub struct AvatarMeshes {
    uvs: Buffer,
    indices: Buffer,
    parts: Vec<PartRange>,
    materials: Vec<BindGroup>,
    vertices: usize,
}

/// Where a part is in the buffers, and how it is drawn.
struct PartRange {
    indices: std::ops::Range<u32>,
    base_vertex: i32,
    material: usize,
    layer: Layer,
    is_double_sided: bool,
}

impl AvatarMeshes {
    /// Copies `avatar` to the GPU.
    pub fn new(device: &Device, queue: &Queue, pipelines: &Pipelines, avatar: &Avatar) -> Self {
        let filled = |bytes: &[u8], usage| {
            let buffer = buffer(device, bytes.len(), usage | BufferUsages::COPY_DST);
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let uvs: Vec<f32> = avatar
            .parts
            .iter()
            .flat_map(|part| &part.vertices)
            .flat_map(|vertex| vertex.uv.to_array())
            .collect();
        let all: Vec<u32> = avatar
            .parts
            .iter()
            .flat_map(|part| part.indices.clone())
            .collect();
        let views: Vec<TextureView> = avatar
            .pictures
            .iter()
            .map(|picture| upload(device, queue, picture))
            .collect();
        let white = upload(device, queue, &Picture::white());
        let sampler = device.create_sampler(&SamplerDescriptor {
            address_mode_u: AddressMode::Repeat,
            address_mode_v: AddressMode::Repeat,
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            mipmap_filter: MipmapFilterMode::Linear,
            ..Default::default()
        });
        let mut list = avatar.materials.clone();
        list.push(Material::default());
        let bind = |material: &Material| {
            let picture = material.picture.and_then(|picture| views.get(picture));
            let numbers = filled(
                bytemuck::cast_slice(&numbers(material)),
                BufferUsages::UNIFORM,
            );
            group(
                device,
                pipelines,
                &numbers,
                picture.unwrap_or(&white),
                &sampler,
            )
        };
        Self {
            uvs: filled(bytemuck::cast_slice(&uvs), BufferUsages::VERTEX),
            indices: filled(bytemuck::cast_slice(&all), BufferUsages::INDEX),
            parts: ranges(avatar, &list),
            materials: list.iter().map(bind).collect(),
            vertices: avatar.vertices(),
        }
    }

    /// Creates the buffer for the skinned vertices of one picture.
    pub fn vertex_buffer(&self, device: &Device) -> Buffer {
        let usage = BufferUsages::VERTEX | BufferUsages::COPY_DST;
        buffer(device, 4 * FLOATS_PER_VERTEX * self.vertices.max(1), usage)
    }

    /// Draws the shadow of the solid parts with the vertices `skinned`.
    pub fn draw_shadow(&self, pass: &mut RenderPass, pipelines: &Pipelines, skinned: &Buffer) {
        pass.set_pipeline(&pipelines.avatars.shadow);
        self.set_buffers(pass, skinned);
        for part in self.parts.iter().filter(|part| part.layer == Layer::Solid) {
            pass.draw_indexed(part.indices.clone(), part.base_vertex, 0..1);
        }
    }

    /// Draws the parts in `layer` with the vertices `skinned`.
    pub fn draw(
        &self,
        pass: &mut RenderPass,
        pipelines: &Pipelines,
        skinned: &Buffer,
        layer: Layer,
    ) {
        self.set_buffers(pass, skinned);
        for part in self.parts.iter().filter(|part| part.layer == layer) {
            pass.set_pipeline(pipelines.avatars.body(layer, part.is_double_sided));
            pass.set_bind_group(2, &self.materials[part.material], &[]);
            pass.draw_indexed(part.indices.clone(), part.base_vertex, 0..1);
        }
    }

    fn set_buffers(&self, pass: &mut RenderPass, skinned: &Buffer) {
        pass.set_vertex_buffer(0, skinned.slice(..));
        pass.set_vertex_buffer(1, self.uvs.slice(..));
        pass.set_index_buffer(self.indices.slice(..), IndexFormat::Uint32);
    }
}

/// Returns where the parts of `avatar` are in the buffers. The last of `materials` is the default one.
fn ranges(avatar: &Avatar, materials: &[Material]) -> Vec<PartRange> {
    let (mut index, mut vertex) = (0, 0);
    let range = |part: &crate::avatar::Part| {
        let last = materials.len() - 1;
        let material = part.material.filter(|&n| n < last).unwrap_or(last);
        let range = PartRange {
            indices: index..index + part.indices.len() as u32,
            base_vertex: vertex,
            material,
            layer: match materials[material].transparency {
                Transparency::Blend => Layer::Blended,
                Transparency::Opaque | Transparency::Mask(_) => Layer::Solid,
            },
            is_double_sided: materials[material].is_double_sided,
        };
        index = range.indices.end;
        vertex += part.vertices.len() as i32;
        range
    };
    avatar.parts.iter().map(range).collect()
}

/// Returns the numbers of `material` in the order of `Material` in `avatar.wgsl`.
fn numbers(material: &Material) -> [f32; 12] {
    let cutoff = match material.transparency {
        Transparency::Opaque => OPAQUE_CUTOFF,
        Transparency::Mask(cutoff) => cutoff,
        Transparency::Blend => 0.0,
    };
    let is_blended = f32::from(u8::from(material.transparency == Transparency::Blend));
    let mut numbers = [0.0; 12];
    numbers[..4].copy_from_slice(&material.colour.to_array());
    numbers[4..7].copy_from_slice(&material.shade.to_array());
    numbers[7..].copy_from_slice(&[cutoff, material.toony, material.shift, is_blended, 0.0]);
    numbers
}

fn group(
    device: &Device,
    pipelines: &Pipelines,
    numbers: &Buffer,
    picture: &TextureView,
    sampler: &Sampler,
) -> BindGroup {
    device.create_bind_group(&BindGroupDescriptor {
        label: None,
        layout: &pipelines.avatars.material,
        entries: &[
            BindGroupEntry {
                binding: 0,
                resource: numbers.as_entire_binding(),
            },
            BindGroupEntry {
                binding: 1,
                resource: BindingResource::TextureView(picture),
            },
            BindGroupEntry {
                binding: 2,
                resource: BindingResource::Sampler(sampler),
            },
        ],
    })
}

/// Copies a picture and its smaller copies to the GPU.
fn upload(device: &Device, queue: &Queue, picture: &Picture) -> TextureView {
    let (width, height) = picture.levels[0].dimensions();
    let texture = device.create_texture(&TextureDescriptor {
        label: None,
        size: extent([width, height]),
        mip_level_count: picture.levels.len() as u32,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: FORMAT,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (level, pixels) in picture.levels.iter().enumerate() {
        let (width, height) = pixels.dimensions();
        let to = TexelCopyTextureInfo {
            texture: &texture,
            mip_level: level as u32,
            origin: Origin3d::ZERO,
            aspect: TextureAspect::All,
        };
        let layout = TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * width),
            rows_per_image: None,
        };
        queue.write_texture(to, pixels, layout, extent([width, height]));
    }
    view(&texture)
}
