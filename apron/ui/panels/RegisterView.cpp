// The large view of a register: palette, range, zoom, pan, value at the cursor, statistics, histogram.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

using debugger::Cell;
using debugger::palette_rgb8;
using debugger::ValueRange;

// The area in which the register is drawn, with the mapping from pixels to cells.
struct RegisterCanvas {
  ImVec2 corner, size;     // of the visible area
  ImVec2 origin;           // of the register's north-west corner, which may be outside the visible area
  float cell_edge = 1.0F;  // pixels
  std::uint32_t width = 0, height = 0;
  CellLayout layout;
  CellPoint extent;  // of the register

  std::optional<Cell> cell_at(ImVec2 p) const {
    const bool inside =
        p.x >= corner.x && p.y >= corner.y && p.x < corner.x + size.x && p.y < corner.y + size.y;
    return inside ? layout.cell_at(to_cells(p), width, height) : std::nullopt;
  }
  CellPoint to_cells(ImVec2 p) const { return {(p.x - origin.x) / cell_edge, (p.y - origin.y) / cell_edge}; }
  ImVec2 to_screen(CellPoint p) const { return {origin.x + p.x * cell_edge, origin.y + p.y * cell_edge}; }
};

void draw_style_controls(DrawContext& context, std::size_t reg) {
  ViewModel& model = context.model;
  RegisterStyle style = model.register_style(reg);
  bool changed = false;
  ImGui::SetNextItemWidth(context.to_pixels(104));
  if (ImGui::BeginCombo("##palette", std::string(common::palette_name(style.palette)).c_str(),
                        ImGuiComboFlags_HeightLarge)) {
    for (std::size_t i = 0; i < common::palette_count(); ++i) {
      const auto palette = static_cast<common::Palette>(i);
      if (!ImGui::Selectable(std::string(common::palette_name(palette)).c_str(), palette == style.palette))
        continue;
      style.palette = palette;
      changed = true;
    }
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  if (ImGui::Checkbox("Auto", &style.auto_range)) {
    changed = true;
    if (!style.auto_range && model.snapshot().full)
      style.range = debugger::automatic_range(model.statistics());
  }
  draw_tooltip("The palette spans the values of the cells, and 0");
  if (!style.auto_range) {
    for (float* bound : {&style.range.low, &style.range.high}) {
      ImGui::SameLine();
      ImGui::SetNextItemWidth(context.to_pixels(62));
      ImGui::PushID(bound);
      changed = ImGui::InputFloat("##end", bound, 0.0F, 0.0F, "%.4g") || changed;
      ImGui::PopID();
    }
  }
  if (changed) model.set_style(reg, style);
}

void draw_header(DrawContext& context, std::size_t reg) {
  const program::Register& r = context.model.program().registers[reg];
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%s", r.name.c_str());
  ImGui::SameLine();
  ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "%u\u00d7%u", r.width, r.height);
  ImGui::SameLine(0.0F, context.to_pixels(16));
  draw_style_controls(context, reg);
  if (context.model.viewport.zoom > 1.0F) {
    ImGui::SameLine();
    if (ImGui::Button("All")) context.model.viewport = {};
  }
  if (context.model.tiled_registers().size() < 2) return;
  ImGui::SameLine();
  if (ImGui::Button("Tiles")) context.model.set_tiled(true);
  draw_tooltip("All registers that the program shows");
}

RegisterCanvas layout_canvas(const DrawContext& context, ImVec2 corner, ImVec2 available,
                             const debugger::SampledRegister& sample) {
  const Viewport& viewport = context.model.viewport;
  RegisterCanvas canvas;
  canvas.width = sample.width;
  canvas.height = sample.height;
  canvas.layout = context.model.cell_layout(sample);
  canvas.extent = canvas.layout.extent(sample.width, sample.height);
  const auto [w, h] = canvas.extent;
  const float fit = std::min(available.x / w, available.y / h);
  canvas.size = {std::max(1.0F, std::floor(fit * w)), std::max(1.0F, std::floor(fit * h))};
  canvas.corner = {std::floor(corner.x + (available.x - canvas.size.x) / 2.0F), std::floor(corner.y)};
  canvas.cell_edge = fit * viewport.zoom;
  canvas.origin = {canvas.corner.x + canvas.size.x / 2.0F - viewport.x * w * canvas.cell_edge,
                   canvas.corner.y + canvas.size.y / 2.0F - viewport.y * h * canvas.cell_edge};
  return canvas;
}

void handle_mouse(ViewModel& model, const RegisterCanvas& canvas, const std::optional<Cell>& hovered_cell) {
  const ImGuiIO& io = ImGui::GetIO();
  const ImVec2 full_size{canvas.cell_edge * canvas.extent.x, canvas.cell_edge * canvas.extent.y};
  if (ImGui::IsItemHovered() && io.MouseWheel != 0.0F)
    model.viewport.zoom_about((io.MousePos.x - canvas.origin.x) / full_size.x,
                              (io.MousePos.y - canvas.origin.y) / full_size.y,
                              std::pow(1.25F, io.MouseWheel));
  if (ImGui::IsItemActive() && ImGui::IsMouseDragging(0, 4.0F)) {
    model.viewport.pan(-io.MouseDelta.x / full_size.x, -io.MouseDelta.y / full_size.y);
  }
  if (ImGui::IsItemHovered() && ImGui::IsMouseDoubleClicked(0)) model.viewport = {};
  const ImVec2 drag_delta = ImGui::GetMouseDragDelta(0, 4.0F);
  if (ImGui::IsItemHovered() && ImGui::IsMouseReleased(0) && drag_delta.x == 0.0F && drag_delta.y == 0.0F &&
      hovered_cell)
    model.probe_cell(*hovered_cell);
}

// Draws the values into the cells if these are large enough.
void draw_cell_values(const DrawContext& context, ImDrawList& list, const RegisterCanvas& canvas,
                      const debugger::SampledRegister& sample, const RegisterStyle& style,
                      const ValueRange& range) {
  if (canvas.cell_edge < context.to_pixels(46)) return;
  const CellRange visible =
      canvas.layout.cells_within(canvas.to_cells(canvas.corner), canvas.to_cells(canvas.corner + canvas.size),
                                 sample.width, sample.height);
  for (std::uint32_t y = visible.first_y; y < visible.end_y; ++y)
    for (std::uint32_t x = visible.first_x; x < visible.end_x; ++x) {
      const float value = sample.cells[std::size_t{y} * sample.width + x];
      const debugger::Rgb8 c = palette_rgb8(style.palette, range, value);
      const bool dark = 0.3F * c.red + 0.6F * c.green + 0.1F * c.blue < 140.0F;
      char text[24];
      std::snprintf(text, sizeof text, "%.4g", static_cast<double>(value));
      const ImVec2 size = ImGui::CalcTextSize(text);
      const ImVec2 center = canvas.to_screen(canvas.layout.centre({x, y}));
      list.AddText({center.x - size.x / 2.0F, center.y - size.y / 2.0F},
                   dark ? IM_COL32_WHITE : IM_COL32_BLACK, text);
    }
}

void draw_cell_outline(ImDrawList& list, const RegisterCanvas& canvas, const Cell& cell, ImU32 colour,
                       float thickness) {
  const CellPoint centre = canvas.layout.centre(cell);
  if (canvas.layout.hexagonal()) {
    std::array<ImVec2, 6> corners;
    const float edge = canvas.cell_edge + 2.0F * thickness;
    std::ranges::transform(CellLayout::hexagon(), corners.begin(), [&](const CellPoint& corner) {
      return canvas.to_screen(centre) + ImVec2{edge * corner.x, edge * corner.y};
    });
    list.AddPolyline(corners.data(), 6, IM_COL32(255, 255, 255, 220), ImDrawFlags_Closed, thickness + 1.0F);
    list.AddPolyline(corners.data(), 6, colour, ImDrawFlags_Closed, thickness);
    return;
  }
  const ImVec2 a = canvas.to_screen({centre.x - 0.5F, centre.y - 0.5F}),
               b = canvas.to_screen({centre.x + 0.5F, centre.y + 0.5F});
  list.AddRect({a.x - thickness, a.y - thickness}, {b.x + thickness, b.y + thickness},
               IM_COL32(255, 255, 255, 220), 0.0F, 0, thickness + 1.0F);
  list.AddRect({a.x - thickness, a.y - thickness}, {b.x + thickness, b.y + thickness}, colour, 0.0F, 0,
               thickness);
}

// Labels the first and last visible columns at the top and rows at the left.
void draw_axes(const DrawContext& context, ImDrawList& list, const RegisterCanvas& canvas) {
  const auto number = [](float at, std::uint32_t count) {
    return std::to_string(std::min(static_cast<int>(std::floor(at + 1e-3F)), static_cast<int>(count) - 1));
  };
  const CellPoint first = canvas.to_cells(canvas.corner),
                  last = canvas.to_cells(canvas.corner + canvas.size + ImVec2{-1.0F, -1.0F});
  const float row_pitch = canvas.layout.row_pitch();
  const std::string west = number(first.x, canvas.width), east = number(last.x, canvas.width),
                    north = number(first.y / row_pitch, canvas.height),
                    south = number(last.y / row_pitch, canvas.height);
  const float line = ImGui::GetTextLineHeight(), gap = context.to_pixels(4);
  const ImVec2 c = canvas.corner, s = canvas.size;
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

void draw_legend(const DrawContext& context, ImDrawList& list, ImVec2 corner, float height,
                 const RegisterStyle& style, const ValueRange& range) {
  constexpr int kSteps = 64;
  const float width = context.to_pixels(14), line = ImGui::GetTextLineHeight();
  for (int i = 0; i < kSteps; ++i) {
    const debugger::Rgb8 c =
        debugger::palette_rgb8(style.palette, 1.0F - (static_cast<float>(i) + 0.5F) / kSteps);
    list.AddRectFilled({corner.x, corner.y + height * static_cast<float>(i) / kSteps},
                       {corner.x + width, corner.y + height * static_cast<float>(i + 1) / kSteps},
                       IM_COL32(c.red, c.green, c.blue, 255));
  }
  list.AddRect(corner, {corner.x + width, corner.y + height}, theme::kLine);
  const float x = corner.x + width + context.to_pixels(5);
  list.AddText({x, corner.y}, theme::kFaint, format_short(range.high).c_str());
  list.AddText({x, corner.y + height - line}, theme::kFaint, format_short(range.low).c_str());
}

void draw_canvas(DrawContext& context, const debugger::SampledRegister& sample, std::size_t reg,
                 ImVec2 available, std::optional<Cell>& hovered_cell) {
  ViewModel& model = context.model;
  const RegisterStyle style = model.register_style(reg);
  const ValueRange range = model.value_range(style, sample.cells);
  const float left_margin = context.to_pixels(36), top_margin = ImGui::GetTextLineHeight() + 2.0F,
              right_margin = context.to_pixels(78);
  const ImVec2 start = ImGui::GetCursorScreenPos();
  const RegisterCanvas canvas = layout_canvas(
      context, {start.x + left_margin, start.y + top_margin},
      {std::max(16.0F, available.x - left_margin - right_margin), std::max(16.0F, available.y - top_margin)},
      sample);
  ImGui::SetCursorScreenPos(canvas.corner);
  ImGui::InvisibleButton("field", canvas.size);
  if (ImGui::IsItemHovered()) hovered_cell = canvas.cell_at(ImGui::GetIO().MousePos);
  handle_mouse(model, canvas, hovered_cell);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{canvas.corner + canvas.size};
  list.PushClipRect(canvas.corner, end, true);
  if (canvas.layout.hexagonal()) list.AddRectFilled(canvas.corner, end, theme::kBackdrop);
  draw_cells(context, canvas.origin, canvas.cell_edge, canvas.corner, end, sample, TextureSlot::kFull);
  draw_cell_values(context, list, canvas, sample, style, range);
  if (model.probe_shown)
    draw_cell_outline(list, canvas, model.probed_cell, theme::kAccent, context.to_pixels(2));
  if (hovered_cell)
    draw_cell_outline(list, canvas, *hovered_cell, IM_COL32(30, 30, 30, 255), context.to_pixels(1));
  list.PopClipRect();
  list.AddRect({canvas.corner.x - 1.0F, canvas.corner.y - 1.0F}, {end.x + 1.0F, end.y + 1.0F}, theme::kLine);
  draw_axes(context, list, canvas);
  draw_legend(context, list, {end.x + context.to_pixels(10), canvas.corner.y}, canvas.size.y, style, range);
  ImGui::SetCursorScreenPos({start.x, start.y + available.y});
}

void draw_histogram(DrawContext& context, std::size_t reg, ImVec2 size) {
  const debugger::Statistics& statistics = context.model.statistics();
  const RegisterStyle style = context.model.register_style(reg);
  const ValueRange range = context.model.value_range(style, context.model.snapshot().full->cells);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 at = ImGui::GetCursorScreenPos();
  list.AddRectFilled(at, at + size, theme::kBackdrop);
  const std::uint32_t max_count = *std::ranges::max_element(statistics.histogram);
  for (std::size_t i = 0; i < debugger::kHistogramBins && max_count > 0; ++i) {
    if (statistics.histogram[i] == 0) continue;
    // Logarithmic, so that the few cells of an object are visible beside a large empty background.
    const float bar_height = size.y * std::log1p(static_cast<float>(statistics.histogram[i])) /
                             std::log1p(static_cast<float>(max_count));
    const float x = static_cast<float>(i) / debugger::kHistogramBins,
                next = static_cast<float>(i + 1) / debugger::kHistogramBins;
    const float value = statistics.min + (statistics.max - statistics.min) * (x + next) / 2.0F;
    const debugger::Rgb8 c = palette_rgb8(style.palette, range, value);
    const ImVec2 a{at.x + x * size.x, at.y + size.y - std::max(2.0F, bar_height)},
        b{at.x + next * size.x, at.y + size.y};
    list.AddRectFilled(a, b, IM_COL32(c.red, c.green, c.blue, 255));
    list.AddRect(a, b, IM_COL32(90, 100, 115, 110));
  }
  ImGui::Dummy(size);
  if (!ImGui::IsItemHovered()) return;
  const auto bin =
      static_cast<std::size_t>((ImGui::GetIO().MousePos.x - at.x) / size.x * debugger::kHistogramBins);
  if (bin >= debugger::kHistogramBins) return;
  const double width = (double{statistics.max} - double{statistics.min}) / debugger::kHistogramBins;
  ImGui::SetTooltip("%u cells from %.5g to %.5g (logarithmic heights)", statistics.histogram[bin],
                    statistics.min + static_cast<double>(bin) * width,
                    statistics.min + static_cast<double>(bin + 1) * width);
}

void draw_statistics(DrawContext& context, const std::optional<Cell>& hovered_cell) {
  const debugger::Statistics& statistics = context.model.statistics();
  if (hovered_cell && context.model.value_at(*hovered_cell))
    ImGui::Text("column %u  row %u  =  %s", hovered_cell->x, hovered_cell->y,
                format_short(*context.model.value_at(*hovered_cell)).c_str());
  else
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "Point at a cell to read it");
  std::string text = "min " + format_short(statistics.min) + "   max " + format_short(statistics.max) +
                     "   mean " + format_short(statistics.mean) + "   non-zero " +
                     std::to_string(statistics.non_zero);
  if (statistics.non_finite > 0) text += "   non-finite " + std::to_string(statistics.non_finite);
  ImGui::TextUnformatted(text.c_str());
}

}  // namespace

void draw_register_view(DrawContext& context) {
  ViewModel& model = context.model;
  if (model.tiled()) return draw_tiles(context);
  if (!model.selected()) return ImGui::TextUnformatted("The program has no registers");
  const std::size_t reg = *model.selected();
  draw_header(context, reg);
  const debugger::DebugSnapshot& snapshot = model.snapshot();
  if (!snapshot.full || snapshot.full->reg != reg) return;  // the next snapshot has it
  const float histogram_height = context.to_pixels(46);
  const float below_height = histogram_height + 2.0F * ImGui::GetTextLineHeightWithSpacing() +
                             4.0F * ImGui::GetStyle().ItemSpacing.y;
  const ImVec2 available = ImGui::GetContentRegionAvail();
  std::optional<Cell> hovered_cell;
  draw_canvas(context, *snapshot.full, reg,
              {available.x, std::max(available.y - below_height, context.to_pixels(60))}, hovered_cell);
  ImGui::Dummy({0.0F, context.to_pixels(2)});
  draw_statistics(context, hovered_cell);
  draw_histogram(context, reg, {available.x, histogram_height});
}

}  // namespace apron::ui
