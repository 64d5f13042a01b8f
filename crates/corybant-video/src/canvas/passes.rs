//! The render passes of a picture: the shadow map, the dancers, and the stage with the dancers.
//!
//! In: the numbers of a scene on the GPU.
//! Out: commands for the GPU.
//! Thread: any except show and audio.
//! Allocates: what the graphics driver needs.

use wgpu::{
    Color, CommandEncoder, IndexFormat, LoadOp, Operations, RenderPassColorAttachment,
    RenderPassDescriptor, StoreOp, TextureView,
};

use super::{Canvas, RenderTargets, Slot};
use crate::Background;
use crate::avatar_meshes::Layer;
use crate::gpu::{depth, view};
use crate::lights::BEAMS_MAX;
use crate::view::View;

/// Returns the colour attachment of a pass that begins with the colour `clear` everywhere.
fn attachment(view: &TextureView, clear: Color) -> RenderPassColorAttachment<'_> {
    RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations {
            load: LoadOp::Clear(clear),
            store: StoreOp::Store,
        },
    }
}

impl Canvas {
    /// Draws the shadow map.
    pub(super) fn draw_shadows(
        &self,
        commands: &mut CommandEncoder,
        targets: &RenderTargets,
        slot: &Slot,
    ) {
        let mut pass = commands.begin_render_pass(&RenderPassDescriptor {
            depth_stencil_attachment: Some(depth(&targets.shadow, StoreOp::Store)),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines.shadow);
        pass.set_bind_group(0, &slot.group, &[]);
        self.draw_pieces(&mut pass, targets, slot);
        for (avatar, skin) in self.avatars.iter().zip(&slot.skins) {
            avatar.draw_shadow(&mut pass, &self.pipelines, skin);
        }
    }

    /// Draws the dancers on a transparent background, with several samples for each pixel.
    pub(super) fn draw_dancers(
        &self,
        commands: &mut CommandEncoder,
        targets: &RenderTargets,
        slot: &Slot,
    ) {
        let colour = attachment(&self.sampled, Color::TRANSPARENT);
        let mut pass = commands.begin_render_pass(&RenderPassDescriptor {
            color_attachments: &[Some(colour)],
            depth_stencil_attachment: Some(depth(&self.depth, StoreOp::Discard)),
            ..Default::default()
        });
        pass.set_bind_group(0, &slot.group, &[]);
        pass.set_bind_group(1, &targets.shadows, &[]);
        pass.set_pipeline(&self.pipelines.body);
        self.draw_pieces(&mut pass, targets, slot);
        self.draw_avatars(&mut pass, slot, Layer::Solid);
        self.draw_avatars(&mut pass, slot, Layer::Blended);
    }

    /// Draws the stage, and the dancers over it. Only the rectangle of the picture in which the
    /// dancers are is composited, and the stage has one sample for each pixel: software renderers
    /// would otherwise need half of their time for samples that are all equal.
    pub(super) fn draw_picture(
        &self,
        commands: &mut CommandEncoder,
        targets: &RenderTargets,
        slot: &Slot,
        seen: View,
    ) {
        let resolved = view(&self.colour);
        let clear = match self.background {
            Background::Stage => Color::BLACK,
            Background::Transparent => Color::TRANSPARENT,
        };
        let mut pass = commands.begin_render_pass(&RenderPassDescriptor {
            color_attachments: &[Some(attachment(&resolved, clear))],
            ..Default::default()
        });
        if self.background == Background::Stage {
            pass.set_bind_group(0, &slot.group, &[]);
            pass.set_bind_group(1, &targets.shadows, &[]);
            self.draw_stage(&mut pass, seen);
        }
        let [left, top, right, bottom] = seen.dancers;
        if left < right && top < bottom {
            pass.set_pipeline(&self.pipelines.composite);
            pass.set_bind_group(0, &self.dancers, &[]);
            pass.set_scissor_rect(left, top, right - left, bottom - top);
            pass.draw(0..3, 0..1);
        }
    }

    fn draw_avatars(&self, pass: &mut wgpu::RenderPass, slot: &Slot, layer: Layer) {
        for (avatar, skin) in self.avatars.iter().zip(&slot.skins) {
            avatar.draw(pass, &self.pipelines, skin, layer);
        }
    }

    /// Draws floor, backdrop and beams.
    fn draw_stage(&self, pass: &mut wgpu::RenderPass, seen: View) {
        // Shadows are only computed for the part of the floor that can have them.
        let [width, height] = [self.size.width, self.size.height];
        let View {
            horizon,
            near: [left, top, right, bottom],
            ..
        } = seen;
        let parts = [
            (&self.pipelines.backdrop, [0, 0, width, horizon]),
            (&self.pipelines.floor, [0, horizon, width, top]),
            (&self.pipelines.floor, [0, top, left, bottom]),
            (&self.pipelines.near, [left, top, right, bottom]),
            (&self.pipelines.floor, [right, top, width, bottom]),
            (&self.pipelines.floor, [0, bottom, width, height]),
        ];
        for (pipeline, [left, top, right, bottom]) in parts {
            if left < right && top < bottom {
                pass.set_pipeline(pipeline);
                pass.set_scissor_rect(left, top, right - left, bottom - top);
                pass.draw(0..3, 0..1);
            }
        }
        pass.set_pipeline(&self.pipelines.beams);
        pass.set_scissor_rect(0, 0, width, height);
        pass.draw(0..6, 0..BEAMS_MAX as u32);
    }

    fn draw_pieces(&self, pass: &mut wgpu::RenderPass, targets: &RenderTargets, slot: &Slot) {
        pass.set_vertex_buffer(0, self.mesh.slice(..));
        pass.set_vertex_buffer(1, slot.pieces.slice(..));
        pass.set_index_buffer(self.triangles.slice(..), IndexFormat::Uint16);
        pass.draw_indexed(0..self.corners, 0, 0..targets.pieces);
    }
}
