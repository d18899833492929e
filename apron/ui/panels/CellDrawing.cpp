// The cells of a register in the colours of its palette: a texture, or hexagons.
#include <cstdint>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

constexpr float kMinHexagon_px = 5.0F;  // narrower ones are not told from bricks

void draw_hexagons(ImDrawList& list, const CellLayout& layout, ImVec2 origin, float cell_edge,
                   const CellRange& visible, const debugger::SampledRegister& sample,
                   const RegisterStyle& style, const debugger::ValueRange& range) {
  // A narrow gap separates neighbours of one colour.
  const float edge = cell_edge >= 8.0F ? cell_edge - 1.0F : cell_edge;
  const ImVec2 white = ImGui::GetFontTexUvWhitePixel();
  for (std::uint32_t y = visible.first_y; y < visible.end_y; ++y)
    for (std::uint32_t x = visible.first_x; x < visible.end_x; ++x) {
      const debugger::Rgb8 c =
          debugger::palette_rgb8(style.palette, range, sample.cells[std::size_t{y} * sample.width + x]);
      const CellPoint centre = layout.centre({x, y});
      const ImVec2 at{origin.x + cell_edge * centre.x, origin.y + cell_edge * centre.y};
      list.PrimReserve(12, 6);
      const auto first = static_cast<ImDrawIdx>(list._VtxCurrentIdx);
      for (int i = 1; i < 5; ++i)
        for (const int corner : {0, i, i + 1}) list.PrimWriteIdx(static_cast<ImDrawIdx>(first + corner));
      for (const CellPoint& corner : CellLayout::hexagon())
        list.PrimWriteVtx({at.x + edge * corner.x, at.y + edge * corner.y}, white,
                          IM_COL32(c.red, c.green, c.blue, 255));
    }
}

}  // namespace

void draw_cells(DrawContext& context, ImVec2 origin, float cell_edge, ImVec2 visible_corner,
                ImVec2 visible_end, const debugger::SampledRegister& sample, TextureSlot slot) {
  const ViewModel& model = context.model;
  const CellLayout layout = model.cell_layout(sample);
  const RegisterStyle style = model.register_style(sample.reg);
  const debugger::ValueRange range = model.value_range(style, sample.cells);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  // Without offsets a list has at most 65 536 vertices.
  const bool many = (ImGui::GetIO().BackendFlags & ImGuiBackendFlags_RendererHasVtxOffset) != 0;
  if (layout.hexagonal() && cell_edge >= kMinHexagon_px && many) {
    const auto in_cells = [&](ImVec2 p) {
      return CellPoint{(p.x - origin.x) / cell_edge, (p.y - origin.y) / cell_edge};
    };
    const CellRange visible =
        layout.cells_within(in_cells(visible_corner), in_cells(visible_end), sample.width, sample.height);
    return draw_hexagons(list, layout, origin, cell_edge, visible, sample, style, range);
  }
  const CellPoint extent = layout.extent(sample.width, sample.height);
  const unsigned texture = context.textures.get(sample, layout, slot, style, range, model.snapshot_serial());
  list.AddImage(reinterpret_cast<ImTextureID>(static_cast<std::intptr_t>(texture)), origin,
                {origin.x + cell_edge * extent.x, origin.y + cell_edge * extent.y});
}

}  // namespace apron::ui
