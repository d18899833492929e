// All registers, small: name, size, palette.
#include <algorithm>
#include <cmath>
#include <string>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

// More of them than that are shown smaller.
constexpr std::size_t kManyRegisters = 8;

constexpr float kLeastText = 0.7F;  // of its size: smaller is not legible

void picture(Stage& stage, ImVec2 corner, float edge, std::size_t reg) {
  ImGui::GetWindowDrawList()->AddRectFilled(corner, {corner.x + edge, corner.y + edge}, theme::kBackdrop);
  if (const debugger::Shot* shot = find_shot(stage.bench.look().small, reg))
    draw_shot(stage, corner, {edge, edge}, *shot, ShotUse::kSmall);
}

void thumbnail(Stage& stage, std::size_t reg, float edge) {
  Workbench& bench = stage.bench;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float line = ImGui::GetTextLineHeight();
  const ImVec2 size{edge, edge + 2.0F * line + stage.px(8)};
  ImGui::PushID(static_cast<int>(reg));
  if (ImGui::InvisibleButton("pick", size)) bench.select(reg);
  const bool hovered = ImGui::IsItemHovered(), selected = bench.selected() == reg;
  ImGui::PopID();
  bench.small_visible.push_back(reg);
  picture(stage, corner, edge, reg);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float thick = selected ? stage.px(2.5F) : stage.px(1);
  list.AddRect(corner, {corner.x + edge, corner.y + edge},
               selected || hovered ? theme::kAccent : theme::kLine, 0.0F, 0, thick);
  const program::Register& r = bench.program().registers[reg];
  const float top = corner.y + edge + stage.px(3);
  fitted_text(list, {corner.x, top}, edge, ImGui::GetColorU32(ImGuiCol_Text), title(bench, reg));
  const std::string about = std::to_string(r.width) + "\u00d7" + std::to_string(r.height) + " " +
                            std::string(palette_name(bench.style(reg).palette));
  ImGui::PushFont(stage.gui.small());
  fitted_text(list, {corner.x, top + line}, edge, theme::kFaint, about);
  ImGui::PopFont();
  if (hovered) ImGui::SetTooltip("%s  %u\u00d7%u", r.name.c_str(), r.width, r.height);
}

}  // namespace

std::string title(const Workbench& bench, std::size_t reg) {
  const std::string& name = bench.program().registers[reg].name;
  const auto wanted = bench.panel().appearances.find(name);
  return wanted == bench.panel().appearances.end() || wanted->second.title.empty() ? name
                                                                                   : wanted->second.title;
}

void fitted_text(ImDrawList& list, ImVec2 at, float width, ImU32 colour, const std::string& text) {
  const float full = ImGui::GetFontSize(), long_by = ImGui::CalcTextSize(text.c_str()).x / width;
  const float size = std::floor(full / std::clamp(long_by, 1.0F, 1.0F / kLeastText));
  list.PushClipRect(at, {at.x + width, at.y + ImGui::GetTextLineHeight() + 2.0F}, true);
  list.AddText(ImGui::GetFont(), size, {at.x, at.y + (full - size) / 2.0F}, colour, text.c_str());
  list.PopClipRect();
}

const debugger::Shot* find_shot(const std::vector<debugger::Shot>& shots, std::size_t reg) {
  const auto found =
      std::find_if(shots.begin(), shots.end(), [&](const debugger::Shot& shot) { return shot.reg == reg; });
  return found == shots.end() ? nullptr : &*found;
}

void draw_shot(Stage& stage, ImVec2 corner, ImVec2 room, const debugger::Shot& shot, ShotUse use) {
  const Style style = stage.bench.style(shot.reg);
  const unsigned texture =
      stage.textures.of(shot, use, style, stage.bench.range(style, shot.cells), stage.bench.serial());
  const auto width = static_cast<float>(shot.width), height = static_cast<float>(shot.height);
  const float cell = std::min(room.x / width, room.y / height);
  const ImVec2 size{cell * width, cell * height};
  const ImVec2 at{corner.x + (room.x - size.x) / 2.0F, corner.y + (room.y - size.y) / 2.0F};
  ImGui::GetWindowDrawList()->AddImage(reinterpret_cast<ImTextureID>(static_cast<std::intptr_t>(texture)), at,
                                       {at.x + size.x, at.y + size.y});
}

void draw_registers(Stage& stage) {
  Workbench& bench = stage.bench;
  ImGui::TextUnformatted("Registers");
  ImGui::BeginChild("all", {0.0F, -ImGui::GetFrameHeightWithSpacing()});
  bench.small_visible.clear();
  // Room for the scroll bar, whether it is there or not: sizes must not depend on it.
  const float width = ImGui::GetWindowWidth() - ImGui::GetStyle().ScrollbarSize, gap = stage.px(8);
  const float least = stage.px(bench.listed().size() > kManyRegisters ? 74 : 130);
  const int columns = std::clamp(static_cast<int>(width / least), 1, 3);
  const float edge =
      std::floor((width - gap * static_cast<float>(columns - 1)) / static_cast<float>(columns));
  const float height = edge + 2.0F * ImGui::GetTextLineHeight() + stage.px(8);
  int column = 0;
  for (const std::size_t reg : bench.listed()) {
    if (column > 0) ImGui::SameLine(0.0F, gap);
    column = (column + 1) % columns;
    if (ImGui::IsRectVisible({edge, height}))
      thumbnail(stage, reg, edge);
    else
      ImGui::Dummy({edge, height});
  }
  ImGui::EndChild();
  ImGui::Checkbox("Temporaries", &bench.temporaries_shown);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("Registers that the compiler and macros made");
}

}  // namespace apron::ui
