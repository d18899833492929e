// The tiled view: the registers that the program shows, side by side.
#include <algorithm>
#include <cmath>
#include <string>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

struct TileLayout {
  int columns = 1;
  ImVec2 tile;  // including its line of text
};

ImVec2 tile_size(const DrawContext& context, ImVec2 available, int count, int columns) {
  const float gap = context.to_pixels(8);
  const auto along = [&](float length, int n) {
    return std::max(1.0F, std::floor((length - gap * static_cast<float>(n - 1)) / static_cast<float>(n)));
  };
  return {along(available.x, columns), along(available.y, (count + columns - 1) / columns)};
}

// Uses the number of columns that the program requests, or else the one that makes the tiles largest.
TileLayout tile_layout(const DrawContext& context, ImVec2 available, int count) {
  if (const int requested = std::min(context.model.tile_columns(), count); requested > 0)
    return {requested, tile_size(context, available, count, requested)};
  TileLayout best;
  float largest = 0.0F;
  for (int columns = 1; columns <= count; ++columns) {
    const ImVec2 size = tile_size(context, available, count, columns);
    const float edge = std::min(size.x, size.y - ImGui::GetTextLineHeightWithSpacing());
    if (edge <= largest) continue;
    largest = edge;
    best = {columns, size};
  }
  return best;
}

// A padlock in the corner of a tile, which locks and unlocks it.
void draw_lock(DrawContext& context, ImVec2 at, float edge, std::size_t reg) {
  ImGui::SetCursorScreenPos(at);
  const bool locked = context.model.locked_tile(reg) != nullptr;
  if (ImGui::InvisibleButton("lock", {edge, edge})) context.model.toggle_tile_lock(reg);
  const bool hovered = ImGui::IsItemHovered();
  if (hovered) ImGui::SetTooltip(locked ? "Unlock: follow the program" : "Lock: keep the cells of this tick");
  const ImU32 colour = locked || hovered ? theme::kAccent : theme::kFaint;
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float u = edge / 16.0F, open = locked ? 0.0F : -3.0F * u, thickness = 1.6F * u;
  list.AddRectFilled({at.x + 4.0F * u, at.y + 7.0F * u}, {at.x + 13.0F * u, at.y + 14.0F * u}, colour, u);
  list.PathArcTo({at.x + 8.5F * u + open, at.y + 6.0F * u}, 2.8F * u, 3.1416F, 6.2832F, 8);
  list.PathStroke(colour, 0, thickness);
  list.AddLine({at.x + 11.3F * u + open, at.y + 6.0F * u}, {at.x + 11.3F * u + open, at.y + 8.0F * u}, colour,
               thickness);
  if (locked)
    list.AddLine({at.x + 5.7F * u, at.y + 6.0F * u}, {at.x + 5.7F * u, at.y + 8.0F * u}, colour, thickness);
}

void draw_tile(DrawContext& context, std::size_t reg, ImVec2 size) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::PushID(static_cast<int>(reg));
  const bool picked = ImGui::InvisibleButton("tile", size);
  const bool hovered = ImGui::IsItemHovered();
  ImGui::SetItemAllowOverlap();
  const ViewModel::LockedTile* locked = context.model.locked_tile(reg);
  const float lock_edge = ImGui::GetTextLineHeight();
  draw_lock(context, {corner.x + size.x - lock_edge, corner.y}, lock_edge, reg);
  ImGui::PopID();
  const program::Register& r = context.model.program().registers[reg];
  const std::string size_text = std::to_string(r.width) + "\u00d7" + std::to_string(r.height);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const std::string title =
      register_title(context.model, reg) + (locked ? ", tick " + std::to_string(locked->tick) : "");
  draw_fitted_text(list, corner, std::max(1.0F, size.x - lock_edge), ImGui::GetColorU32(ImGuiCol_Text),
                   title);
  const float line = ImGui::GetTextLineHeightWithSpacing();
  const ImVec2 top{corner.x, corner.y + line}, end{corner + size};
  list.AddRectFilled(top, end, theme::kBackdrop);
  if (const debugger::SampledRegister* sample =
          locked ? &locked->sample : find_sample(context.model.snapshot().tiles, reg))
    draw_register_image(context, top, {size.x, size.y - line}, *sample, TextureSlot::kTile);
  list.AddRect(top, end, hovered || locked ? theme::kAccent : theme::kLine, 0.0F, 0,
               context.to_pixels(locked ? 2.0F : 1.0F));
  if (hovered) ImGui::SetTooltip("%s  %s", r.name.c_str(), size_text.c_str());
  if (picked) context.model.select(reg);
}

}  // namespace

void draw_tiles(DrawContext& context) {
  const std::vector<std::size_t> tiles = context.model.tiled_registers();
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%zu registers", tiles.size());
  ImGui::SameLine(0.0F, context.to_pixels(16));
  if (ImGui::Button("One")) context.model.set_tiled(false);
  draw_tooltip("Enlarge one register; click a tile to enlarge that one");
  ImVec2 available = ImGui::GetContentRegionAvail();
  available.y = std::max(available.y - ImGui::GetStyle().ItemSpacing.y, context.to_pixels(60));
  const TileLayout layout = tile_layout(context, available, static_cast<int>(tiles.size()));
  const ImVec2 start = ImGui::GetCursorScreenPos();
  const float gap = context.to_pixels(8);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto column = static_cast<float>(static_cast<int>(i) % layout.columns),
               row = static_cast<float>(static_cast<int>(i) / layout.columns);
    ImGui::SetCursorScreenPos(
        {start.x + column * (layout.tile.x + gap), start.y + row * (layout.tile.y + gap)});
    draw_tile(context, tiles[i], layout.tile);
  }
}

}  // namespace apron::ui
