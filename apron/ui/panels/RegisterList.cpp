// The register list: a thumbnail of every register with name, size and palette.
#include <algorithm>
#include <cmath>
#include <string>

#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

// Above this number, thumbnails are smaller.
constexpr std::size_t kManyRegisters = 8;

constexpr float kMinTextScale = 0.7F;  // smaller text is not legible

void draw_thumbnail_image(DrawContext& context, ImVec2 corner, float edge, std::size_t reg) {
  ImGui::GetWindowDrawList()->AddRectFilled(corner, {corner.x + edge, corner.y + edge}, theme::kBackdrop);
  if (const debugger::SampledRegister* sample = find_sample(context.model.snapshot().thumbnails, reg))
    draw_register_image(context, corner, {edge, edge}, *sample, TextureSlot::kThumbnail);
}

void draw_thumbnail(DrawContext& context, std::size_t reg, float edge) {
  ViewModel& model = context.model;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float line = ImGui::GetTextLineHeight();
  const ImVec2 size{edge, edge + 2.0F * line + context.to_pixels(8)};
  ImGui::PushID(static_cast<int>(reg));
  if (ImGui::InvisibleButton("pick", size)) model.select(reg);
  const bool hovered = ImGui::IsItemHovered(), selected = model.selected() == reg;
  ImGui::PopID();
  model.visible_thumbnails.push_back(reg);
  draw_thumbnail_image(context, corner, edge, reg);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float thickness = selected ? context.to_pixels(2.5F) : context.to_pixels(1);
  list.AddRect(corner, {corner.x + edge, corner.y + edge},
               selected || hovered ? theme::kAccent : theme::kLine, 0.0F, 0, thickness);
  const program::Register& r = model.program().registers[reg];
  const float top = corner.y + edge + context.to_pixels(3);
  draw_fitted_text(list, {corner.x, top}, edge, ImGui::GetColorU32(ImGuiCol_Text),
                   register_title(model, reg));
  const std::string description = std::to_string(r.width) + "\u00d7" + std::to_string(r.height) + " " +
                                  std::string(common::palette_name(model.register_style(reg).palette));
  ImGui::PushFont(context.gui.small());
  draw_fitted_text(list, {corner.x, top + line}, edge, theme::kFaint, description);
  ImGui::PopFont();
  if (hovered) ImGui::SetTooltip("%s  %u\u00d7%u", r.name.c_str(), r.width, r.height);
}

}  // namespace

std::string register_title(const ViewModel& model, std::size_t reg) {
  const std::string& name = model.program().registers[reg].name;
  const auto appearance = model.panel().appearances.find(name);
  return appearance == model.panel().appearances.end() || appearance->second.title.empty()
             ? name
             : appearance->second.title;
}

void draw_fitted_text(ImDrawList& list, ImVec2 at, float width, ImU32 colour, const std::string& text) {
  const float font_size = ImGui::GetFontSize(), excess = ImGui::CalcTextSize(text.c_str()).x / width;
  const float size = std::floor(font_size / std::clamp(excess, 1.0F, 1.0F / kMinTextScale));
  list.PushClipRect(at, {at.x + width, at.y + ImGui::GetTextLineHeight() + 2.0F}, true);
  list.AddText(ImGui::GetFont(), size, {at.x, at.y + (font_size - size) / 2.0F}, colour, text.c_str());
  list.PopClipRect();
}

const debugger::SampledRegister* find_sample(const std::vector<debugger::SampledRegister>& samples,
                                             std::size_t reg) {
  const auto found = std::ranges::find(samples, reg, &debugger::SampledRegister::reg);
  return found == samples.end() ? nullptr : &*found;
}

void draw_register_image(DrawContext& context, ImVec2 corner, ImVec2 available,
                         const debugger::SampledRegister& sample, TextureSlot slot) {
  const CellPoint extent = context.model.cell_layout(sample).extent(sample.width, sample.height);
  const float cell = std::min(available.x / extent.x, available.y / extent.y);
  const ImVec2 size{cell * extent.x, cell * extent.y};
  const ImVec2 at{corner.x + (available.x - size.x) / 2.0F, corner.y + (available.y - size.y) / 2.0F};
  draw_cells(context, at, cell, at, at + size, sample, slot);
}

void draw_register_list(DrawContext& context) {
  ViewModel& model = context.model;
  ImGui::TextUnformatted("Registers");
  ImGui::BeginChild("all", {0.0F, -ImGui::GetFrameHeightWithSpacing()});
  model.visible_thumbnails.clear();
  // Always reserve space for the scroll bar, so that the layout does not depend on whether it is shown.
  const float width = ImGui::GetWindowWidth() - ImGui::GetStyle().ScrollbarSize, gap = context.to_pixels(8);
  const float min_edge = context.to_pixels(model.listed_registers().size() > kManyRegisters ? 74 : 130);
  const int columns = std::clamp(static_cast<int>(width / min_edge), 1, 3);
  const float edge =
      std::floor((width - gap * static_cast<float>(columns - 1)) / static_cast<float>(columns));
  const float height = edge + 2.0F * ImGui::GetTextLineHeight() + context.to_pixels(8);
  int column = 0;
  for (const std::size_t reg : model.listed_registers()) {
    if (column > 0) ImGui::SameLine(0.0F, gap);
    column = (column + 1) % columns;
    if (ImGui::IsRectVisible({edge, height}))
      draw_thumbnail(context, reg, edge);
    else
      ImGui::Dummy({edge, height});
  }
  ImGui::EndChild();
  ImGui::Checkbox("Temporaries", &model.temporaries_shown);
  draw_tooltip("Registers created by the compiler and by macros");
}

}  // namespace apron::ui
