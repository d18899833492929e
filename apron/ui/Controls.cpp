// The bar at the top: what the program does, and the buttons that change it.
#include <cctype>
#include <cstdio>

#include "apron/ui/Panels.h"

namespace apron::ui {
namespace {

void tip(const char* text) {
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", text);
}

bool button(const char* label, const char* help, bool usable = true) {
  ImGui::BeginDisabled(!usable);
  const bool pressed = ImGui::Button(label);
  ImGui::EndDisabled();
  tip(help);
  ImGui::SameLine();
  return pressed;
}

void gap(const Stage& stage) { ImGui::SameLine(0.0F, stage.px(16)); }

void state_text(Stage& stage) {
  const Workbench& bench = stage.bench;
  const bool failed = bench.over() && !bench.look().error.empty();
  ImGui::AlignTextToFramePadding();
  const ImU32 colour = failed ? theme::kStop : bench.running() ? theme::kGo : theme::kAccent;
  ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colour), "%s", bench.state().c_str());
  char text[96];
  int n = std::snprintf(text, sizeof text, "tick %llu", static_cast<unsigned long long>(bench.look().ticks));
  if (bench.look().time_s) n += std::snprintf(text + n, sizeof text - n, "   %.2f s", *bench.look().time_s);
  if (bench.running() && bench.ticks_per_s() > 0.0)
    std::snprintf(text + n, sizeof text - n, "   %.0f ticks/s", bench.ticks_per_s());
  const float width = ImGui::CalcTextSize(text).x;
  ImGui::SameLine();
  const float room = ImGui::GetContentRegionAvail().x;
  if (room < width) return ImGui::NewLine();
  ImGui::SetCursorPosX(ImGui::GetCursorPosX() + room - width);
  ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "%s", text);
}

void messages(Stage& stage) {
  Workbench& bench = stage.bench;
  const std::string& error = bench.over() && !bench.look().error.empty() ? bench.look().error : bench.notice;
  if (error.empty()) return;
  ImGui::PushStyleColor(ImGuiCol_Text, theme::kStop);
  ImGui::TextWrapped("%s", error.c_str());
  ImGui::PopStyleColor();
}

}  // namespace

void draw_controls(Stage& stage) {
  Workbench& bench = stage.bench;
  const bool over = bench.over(), running = bench.running();
  const float wide = stage.px(72);
  ImGui::PushStyleColor(ImGuiCol_Text, running ? theme::kStop : theme::kGo);
  ImGui::BeginDisabled(over);
  if (ImGui::Button(running ? "\u25a0  Stop" : "\u25b6  Run", {wide, 0.0F})) bench.toggle();
  ImGui::EndDisabled();
  ImGui::PopStyleColor();
  tip("Run, or stop at the end of the tick (Space)");
  gap(stage);
  using debugger::Unit;
  const bool held = !over && !running;
  if (button("Tick", "To the next surface.step (\u2192)", held)) bench.step(Unit::kTick);
  if (button("Line", "To the next line as it is folded (\u2193)", held)) bench.step(Unit::kLine);
  if (button("Instruction", "One instruction of the machine (I)", held)) bench.step(Unit::kInstruction);
  if (button("Walk", "Line by line, slowly (W)", held)) bench.walk();
  ImGui::SetNextItemWidth(stage.px(84));
  ImGui::SliderInt("##pace", &bench.lines_per_s, 1, 30, "%d lines/s");
  tip("How fast to walk");
  gap(stage);
  if (button("Reset", "Begin again (R)")) bench.reset();
  if (button("Reload", "Read the program again; done by itself when it is saved")) bench.reload = true;
  if (button("?", "Mouse and keys (F1)")) bench.help_shown = !bench.help_shown;
  if (is_wide(stage))
    gap(stage);
  else
    ImGui::NewLine();
  state_text(stage);
  messages(stage);
}

void take_keys(Workbench& bench) {
  ImGuiIO& io = ImGui::GetIO();
  if (io.WantTextInput) return;
  const auto pressed = [](ImGuiKey key, bool repeat) {
    return ImGui::IsKeyPressed(ImGui::GetKeyIndex(key), repeat);
  };
  const bool held = !bench.running() && !bench.over();
  if (pressed(ImGuiKey_Space, false) && !bench.over()) bench.toggle();
  if (pressed(ImGuiKey_Escape, false)) bench.help_shown = false;
  if (held && pressed(ImGuiKey_RightArrow, true)) bench.step(debugger::Unit::kTick);
  if (held && pressed(ImGuiKey_DownArrow, true)) bench.step(debugger::Unit::kLine);
  for (const ImWchar typed : io.InputQueueCharacters) {
    const int c = typed < 128 ? std::tolower(static_cast<int>(typed)) : 0;
    if (c == 'i' && held) bench.step(debugger::Unit::kInstruction);
    if (c == 'w' && held) bench.walk();
    if (c == 'r') bench.reset();
    if (c == '?') bench.help_shown = !bench.help_shown;
  }
}

void draw_help(Stage& stage) {
  static constexpr const char* kHelp[][2] = {
      {"Space", "run, or stop at the end of the tick"},
      {"\u2192   \u2193   I", "one tick, one line, one instruction"},
      {"W", "walk, line by line"},
      {"R", "reset"},
      {"Click a small register", "show it large"},
      {"Wheel, drag on the large one", "zoom, move; double click: all of it"},
      {"Click on the large one", "watch that cell"},
      {"Click left of a line's number", "breakpoint"},
      {"Click a triangle", "fold or unfold an include or a macro"},
      {"F1   ?   Esc", "this help"}};
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2.0F, size.y / 2.0F}, ImGuiCond_Always, {0.5F, 0.5F});
  ImGui::SetNextWindowFocus();
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {stage.px(18), stage.px(14)});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, stage.px(8));
  ImGui::PushStyleColor(ImGuiCol_WindowBg, IM_COL32(252, 253, 255, 250));
  ImGui::Begin(
      "help", nullptr,
      ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings);
  ImGui::TextUnformatted("Mouse and keys");
  ImGui::Separator();
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const auto& line : kHelp) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(line[0]);
      ImGui::TableNextColumn();
      ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "%s", line[1]);
    }
    ImGui::EndTable();
  }
  if (ImGui::IsMouseClicked(0) && !ImGui::IsWindowHovered()) stage.bench.help_shown = false;
  ImGui::End();
  ImGui::PopStyleColor();
  ImGui::PopStyleVar(2);
}

}  // namespace apron::ui
