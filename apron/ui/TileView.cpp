// The registers that the program shows, side by side.
#include <algorithm>
#include <cmath>
#include <string>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

struct Grid {
  int columns = 1;
  ImVec2 tile;  // with its line of text
};

ImVec2 tile_size(const Stage& stage, ImVec2 room, int count, int columns) {
  const float gap = stage.px(8);
  const auto along = [&](float length, int n) {
    return std::max(1.0F, std::floor((length - gap * static_cast<float>(n - 1)) / static_cast<float>(n)));
  };
  return {along(room.x, columns), along(room.y, (count + columns - 1) / columns)};
}

// As many columns as wanted, or those that make the tiles largest.
Grid grid(const Stage& stage, ImVec2 room, int count) {
  if (const int wanted = std::min(stage.bench.tile_columns(), count); wanted > 0)
    return {wanted, tile_size(stage, room, count, wanted)};
  Grid best;
  float largest = 0.0F;
  for (int columns = 1; columns <= count; ++columns) {
    const ImVec2 size = tile_size(stage, room, count, columns);
    const float edge = std::min(size.x, size.y - ImGui::GetTextLineHeightWithSpacing());
    if (edge <= largest) continue;
    largest = edge;
    best = {columns, size};
  }
  return best;
}

void tile(Stage& stage, std::size_t reg, ImVec2 size) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::PushID(static_cast<int>(reg));
  const bool picked = ImGui::InvisibleButton("tile", size);
  const bool hovered = ImGui::IsItemHovered();
  ImGui::PopID();
  const program::Register& r = stage.bench.program().registers[reg];
  const std::string size_text = std::to_string(r.width) + "\u00d7" + std::to_string(r.height);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  fitted_text(list, corner, size.x, ImGui::GetColorU32(ImGuiCol_Text), title(stage.bench, reg));
  const float line = ImGui::GetTextLineHeightWithSpacing();
  const ImVec2 top{corner.x, corner.y + line}, end{corner.x + size.x, corner.y + size.y};
  list.AddRectFilled(top, end, theme::kBackdrop);
  if (const debugger::Shot* shot = find_shot(stage.bench.look().tiles, reg))
    draw_shot(stage, top, {size.x, size.y - line}, *shot, ShotUse::kTile);
  list.AddRect(top, end, hovered ? theme::kAccent : theme::kLine);
  if (hovered) ImGui::SetTooltip("%s  %s", r.name.c_str(), size_text.c_str());
  if (picked) stage.bench.select(reg);
}

}  // namespace

void draw_tiles(Stage& stage) {
  const std::vector<std::size_t> tiles = stage.bench.tiles();
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%zu registers", tiles.size());
  ImGui::SameLine(0.0F, stage.px(16));
  if (ImGui::Button("One")) stage.bench.set_tiled(false);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("One register, large; a click on a tile shows that one");
  ImVec2 room = ImGui::GetContentRegionAvail();
  room.y = std::max(room.y - ImGui::GetStyle().ItemSpacing.y, stage.px(60));
  const Grid g = grid(stage, room, static_cast<int>(tiles.size()));
  const ImVec2 start = ImGui::GetCursorScreenPos();
  const float gap = stage.px(8);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto column = static_cast<float>(static_cast<int>(i) % g.columns),
               row = static_cast<float>(static_cast<int>(i) / g.columns);
    ImGui::SetCursorScreenPos({start.x + column * (g.tile.x + gap), start.y + row * (g.tile.y + gap)});
    tile(stage, tiles[i], g.tile);
  }
}

}  // namespace apron::ui
