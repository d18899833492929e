// One register, large: palette and range, zoom and pan, the value under the cursor, statistics, histogram.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

using debugger::Cell;
using debugger::PaletteId;
using debugger::Range;

// The part of the window that the register is drawn in, and which cell is where.
struct Field {
  ImVec2 corner, size;  // of the square that is seen
  ImVec2 origin;        // of the register's north-west corner, seen or not
  float cell = 1.0F;    // edge of one, pixels
  std::uint32_t width = 0, height = 0;

  std::optional<Cell> at(ImVec2 p) const {
    const float x = (p.x - origin.x) / cell, y = (p.y - origin.y) / cell;
    const bool inside =
        p.x >= corner.x && p.y >= corner.y && p.x < corner.x + size.x && p.y < corner.y + size.y;
    if (!inside || x < 0.0F || y < 0.0F || x >= static_cast<float>(width) || y >= static_cast<float>(height))
      return std::nullopt;
    return Cell{static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)};
  }
  ImVec2 place(float x, float y) const { return {origin.x + x * cell, origin.y + y * cell}; }
};

void draw_style(Stage& stage, std::size_t reg) {
  Workbench& bench = stage.bench;
  Style style = bench.style(reg);
  bool changed = false;
  ImGui::SetNextItemWidth(stage.px(104));
  if (ImGui::BeginCombo("##palette", std::string(palette_name(style.palette)).c_str(),
                        ImGuiComboFlags_HeightLarge)) {
    for (std::size_t i = 0; i < debugger::kPaletteCount; ++i) {
      const auto one = static_cast<PaletteId>(i);
      if (!ImGui::Selectable(std::string(palette_name(one)).c_str(), one == style.palette)) continue;
      style.palette = one;
      changed = true;
    }
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  if (ImGui::Checkbox("Auto", &style.automatic)) {
    changed = true;
    if (!style.automatic && bench.look().large) style.range = debugger::automatic_range(bench.statistics());
  }
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("The palette spans what the cells hold, and 0");
  if (!style.automatic) {
    for (float* end : {&style.range.low, &style.range.high}) {
      ImGui::SameLine();
      ImGui::SetNextItemWidth(stage.px(62));
      ImGui::PushID(end);
      changed = ImGui::InputFloat("##end", end, 0.0F, 0.0F, "%.4g") || changed;
      ImGui::PopID();
    }
  }
  if (changed) bench.set_style(reg, style);
}

void draw_head(Stage& stage, std::size_t reg) {
  const program::Register& r = stage.bench.program().registers[reg];
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%s", r.name.c_str());
  ImGui::SameLine();
  ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "%u\u00d7%u", r.width, r.height);
  ImGui::SameLine(0.0F, stage.px(16));
  draw_style(stage, reg);
  if (stage.bench.view.zoom > 1.0F) {
    ImGui::SameLine();
    if (ImGui::Button("All")) stage.bench.view = {};
  }
  if (stage.bench.tiles().size() < 2) return;
  ImGui::SameLine();
  if (ImGui::Button("Tiles")) stage.bench.set_tiled(true);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("All registers that the program shows");
}

Field field_in(const Stage& stage, ImVec2 corner, ImVec2 room, const debugger::Shot& shot) {
  const Viewpoint& view = stage.bench.view;
  Field field;
  field.width = shot.width;
  field.height = shot.height;
  const auto w = static_cast<float>(shot.width), h = static_cast<float>(shot.height);
  const float fit = std::min(room.x / w, room.y / h);
  field.size = {std::floor(fit * w), std::floor(fit * h)};
  field.corner = {std::floor(corner.x + (room.x - field.size.x) / 2.0F), std::floor(corner.y)};
  field.cell = fit * view.zoom;
  field.origin = {field.corner.x + field.size.x / 2.0F - view.x * w * field.cell,
                  field.corner.y + field.size.y / 2.0F - view.y * h * field.cell};
  return field;
}

void take_mouse(Workbench& bench, const Field& field, const std::optional<Cell>& under) {
  const ImGuiIO& io = ImGui::GetIO();
  const ImVec2 whole{field.cell * static_cast<float>(field.width),
                     field.cell * static_cast<float>(field.height)};
  if (ImGui::IsItemHovered() && io.MouseWheel != 0.0F)
    bench.view.zoom_about((io.MousePos.x - field.origin.x) / whole.x,
                          (io.MousePos.y - field.origin.y) / whole.y, std::pow(1.25F, io.MouseWheel));
  if (ImGui::IsItemActive() && ImGui::IsMouseDragging(0, 4.0F)) {
    bench.view.pan(-io.MouseDelta.x / whole.x, -io.MouseDelta.y / whole.y);
  }
  if (ImGui::IsItemHovered() && ImGui::IsMouseDoubleClicked(0)) bench.view = {};
  const ImVec2 moved = ImGui::GetMouseDragDelta(0, 4.0F);
  if (ImGui::IsItemHovered() && ImGui::IsMouseReleased(0) && moved.x == 0.0F && moved.y == 0.0F && under)
    bench.watch(*under);
}

// Values in the cells, once these are large enough.
void draw_values_in_cells(const Stage& stage, ImDrawList& list, const Field& field,
                          const debugger::Shot& shot, const Style& style, const Range& range) {
  if (field.cell < stage.px(46)) return;
  const auto first = [&](float at) {
    return static_cast<std::uint32_t>(std::max(0.0F, std::floor(at / field.cell)));
  };
  const std::uint32_t x0 = first(field.corner.x - field.origin.x),
                      y0 = first(field.corner.y - field.origin.y);
  const auto columns = static_cast<std::uint32_t>(field.size.x / field.cell) + 2,
             rows = static_cast<std::uint32_t>(field.size.y / field.cell) + 2;
  for (std::uint32_t y = y0; y < std::min(y0 + rows, shot.height); ++y)
    for (std::uint32_t x = x0; x < std::min(x0 + columns, shot.width); ++x) {
      const float value = shot.cells[std::size_t{y} * shot.width + x];
      const debugger::Colour c = colour(style.palette, range, value);
      const bool dark = 0.3F * c.red + 0.6F * c.green + 0.1F * c.blue < 140.0F;
      char text[24];
      std::snprintf(text, sizeof text, "%.4g", static_cast<double>(value));
      const ImVec2 size = ImGui::CalcTextSize(text);
      const ImVec2 middle = field.place(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      list.AddText({middle.x - size.x / 2.0F, middle.y - size.y / 2.0F},
                   dark ? IM_COL32_WHITE : IM_COL32_BLACK, text);
    }
}

void frame(ImDrawList& list, const Field& field, const Cell& cell, ImU32 colour, float thick) {
  const ImVec2 a = field.place(static_cast<float>(cell.x), static_cast<float>(cell.y));
  const ImVec2 b = field.place(static_cast<float>(cell.x + 1), static_cast<float>(cell.y + 1));
  list.AddRect({a.x - thick, a.y - thick}, {b.x + thick, b.y + thick}, IM_COL32(255, 255, 255, 220), 0.0F, 0,
               thick + 1.0F);
  list.AddRect({a.x - thick, a.y - thick}, {b.x + thick, b.y + thick}, colour, 0.0F, 0, thick);
}

// Numbers of columns above and rows at the left, those of the first and last that are seen.
void draw_axes(const Stage& stage, ImDrawList& list, const Field& field) {
  const auto number = [&](float at) {
    return std::to_string(static_cast<int>(std::floor(at / field.cell + 1e-3F)));
  };
  const std::string west = number(field.corner.x - field.origin.x),
                    east = number(field.corner.x + field.size.x - field.origin.x - 1.0F),
                    north = number(field.corner.y - field.origin.y),
                    south = number(field.corner.y + field.size.y - field.origin.y - 1.0F);
  const float line = ImGui::GetTextLineHeight(), gap = stage.px(4);
  const ImVec2 c = field.corner, s = field.size;
  const auto text = [&](float x, float y, const std::string& t) {
    list.AddText({x, y}, theme::kFaint, t.c_str());
  };
  text(c.x, c.y - line - 1.0F, west);
  text(c.x + s.x - ImGui::CalcTextSize(east.c_str()).x, c.y - line - 1.0F, east);
  text(c.x - gap - ImGui::CalcTextSize(north.c_str()).x, c.y, north);
  text(c.x - gap - ImGui::CalcTextSize(south.c_str()).x, c.y + s.y - line, south);
  const char* up = "north \u2191";
  if (s.x < 3.0F * ImGui::CalcTextSize(up).x) return;
  text(c.x + (s.x - ImGui::CalcTextSize(up).x) / 2.0F, c.y - line - 1.0F, up);
}

void draw_legend(const Stage& stage, ImDrawList& list, ImVec2 corner, float height, const Style& style,
                 const Range& range) {
  constexpr int kSteps = 64;
  const float width = stage.px(14), line = ImGui::GetTextLineHeight();
  for (int i = 0; i < kSteps; ++i) {
    const debugger::Colour c =
        debugger::colour(style.palette, 1.0F - (static_cast<float>(i) + 0.5F) / kSteps);
    list.AddRectFilled({corner.x, corner.y + height * static_cast<float>(i) / kSteps},
                       {corner.x + width, corner.y + height * static_cast<float>(i + 1) / kSteps},
                       IM_COL32(c.red, c.green, c.blue, 255));
  }
  list.AddRect(corner, {corner.x + width, corner.y + height}, theme::kLine);
  const float x = corner.x + width + stage.px(5);
  list.AddText({x, corner.y}, theme::kFaint, short_number(range.high).c_str());
  list.AddText({x, corner.y + height - line}, theme::kFaint, short_number(range.low).c_str());
}

void draw_field(Stage& stage, const debugger::Shot& shot, std::size_t reg, ImVec2 room,
                std::optional<Cell>& under) {
  Workbench& bench = stage.bench;
  const Style style = bench.style(reg);
  const Range range = bench.range(style, shot.cells);
  const float left = stage.px(36), top = ImGui::GetTextLineHeight() + 2.0F, right = stage.px(78);
  const ImVec2 start = ImGui::GetCursorScreenPos();
  const Field field = field_in(stage, {start.x + left, start.y + top},
                               {std::max(16.0F, room.x - left - right), std::max(16.0F, room.y - top)}, shot);
  ImGui::SetCursorScreenPos(field.corner);
  ImGui::InvisibleButton("field", field.size);
  if (ImGui::IsItemHovered()) under = field.at(ImGui::GetIO().MousePos);
  take_mouse(bench, field, under);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{field.corner.x + field.size.x, field.corner.y + field.size.y};
  list.PushClipRect(field.corner, end, true);
  list.AddImage(reinterpret_cast<ImTextureID>(static_cast<std::intptr_t>(
                    stage.textures.of(shot, ShotUse::kLarge, style, range, bench.serial()))),
                field.origin, field.place(static_cast<float>(shot.width), static_cast<float>(shot.height)));
  draw_values_in_cells(stage, list, field, shot, style, range);
  if (bench.cell_shown) frame(list, field, bench.cell, theme::kAccent, stage.px(2));
  if (under) frame(list, field, *under, IM_COL32(30, 30, 30, 255), stage.px(1));
  list.PopClipRect();
  list.AddRect({field.corner.x - 1.0F, field.corner.y - 1.0F}, {end.x + 1.0F, end.y + 1.0F}, theme::kLine);
  draw_axes(stage, list, field);
  draw_legend(stage, list, {end.x + stage.px(10), field.corner.y}, field.size.y, style, range);
  ImGui::SetCursorScreenPos({start.x, start.y + room.y});
}

void draw_histogram(Stage& stage, std::size_t reg, ImVec2 size) {
  const debugger::Statistics& s = stage.bench.statistics();
  const Style style = stage.bench.style(reg);
  const Range range = stage.bench.range(style, stage.bench.look().large->cells);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 at = ImGui::GetCursorScreenPos();
  list.AddRectFilled(at, {at.x + size.x, at.y + size.y}, theme::kBackdrop);
  const std::uint32_t most = *std::max_element(s.histogram.begin(), s.histogram.end());
  for (std::size_t i = 0; i < debugger::kBins && most > 0; ++i) {
    if (s.histogram[i] == 0) continue;
    // By logarithm: a few cells of an object matter beside a whole empty background.
    const float tall =
        size.y * std::log1p(static_cast<float>(s.histogram[i])) / std::log1p(static_cast<float>(most));
    const float x = static_cast<float>(i) / debugger::kBins,
                next = static_cast<float>(i + 1) / debugger::kBins;
    const float value = s.min + (s.max - s.min) * (x + next) / 2.0F;
    const debugger::Colour c = colour(style.palette, range, value);
    const ImVec2 a{at.x + x * size.x, at.y + size.y - std::max(2.0F, tall)},
        b{at.x + next * size.x, at.y + size.y};
    list.AddRectFilled(a, b, IM_COL32(c.red, c.green, c.blue, 255));
    list.AddRect(a, b, IM_COL32(90, 100, 115, 110));
  }
  ImGui::Dummy(size);
  if (!ImGui::IsItemHovered()) return;
  const auto bin = static_cast<std::size_t>((ImGui::GetIO().MousePos.x - at.x) / size.x * debugger::kBins);
  if (bin >= debugger::kBins) return;
  const double width = (double{s.max} - double{s.min}) / debugger::kBins;
  ImGui::SetTooltip("%u cells from %.5g to %.5g (heights: logarithm)", s.histogram[bin],
                    s.min + static_cast<double>(bin) * width, s.min + static_cast<double>(bin + 1) * width);
}

void draw_figures(Stage& stage, const std::optional<Cell>& under) {
  const debugger::Statistics& s = stage.bench.statistics();
  if (under && stage.bench.value(*under))
    ImGui::Text("column %u  row %u  =  %s", under->x, under->y,
                short_number(*stage.bench.value(*under)).c_str());
  else
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "Point at a cell to read it");
  std::string text = "min " + short_number(s.min) + "   max " + short_number(s.max) + "   mean " +
                     short_number(s.mean) + "   non-zero " + std::to_string(s.non_zero);
  if (s.others > 0) text += "   not finite " + std::to_string(s.others);
  ImGui::TextUnformatted(text.c_str());
}

}  // namespace

void draw_large(Stage& stage) {
  Workbench& bench = stage.bench;
  if (bench.tiled()) return draw_tiles(stage);
  if (!bench.selected()) return ImGui::TextUnformatted("The program has no registers");
  const std::size_t reg = *bench.selected();
  draw_head(stage, reg);
  const debugger::Look& look = bench.look();
  if (!look.large || look.large->reg != reg) return;  // it comes with the next look
  const float histogram = stage.px(46);
  const float below =
      histogram + 2.0F * ImGui::GetTextLineHeightWithSpacing() + 4.0F * ImGui::GetStyle().ItemSpacing.y;
  const ImVec2 room = ImGui::GetContentRegionAvail();
  std::optional<Cell> under;
  draw_field(stage, *look.large, reg, {room.x, std::max(room.y - below, stage.px(60))}, under);
  ImGui::Dummy({0.0F, stage.px(2)});
  draw_figures(stage, under);
  draw_histogram(stage, reg, {room.x, histogram});
}

}  // namespace apron::ui
