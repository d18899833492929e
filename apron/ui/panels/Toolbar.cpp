// The toolbar: execution state, and the buttons that control execution.
#include <cctype>
#include <cstdio>

#include "apron/program/Keys.h"
#include "apron/ui/panels/Panels.h"

namespace apron::ui {
namespace {

bool toolbar_button(const char* label, const char* tooltip, bool enabled = true) {
  ImGui::BeginDisabled(!enabled);
  const bool pressed = ImGui::Button(label);
  ImGui::EndDisabled();
  draw_tooltip(tooltip);
  ImGui::SameLine();
  return pressed;
}

void same_line_gap(const DrawContext& context) { ImGui::SameLine(0.0F, context.to_pixels(16)); }

void draw_state(DrawContext& context) {
  const ViewModel& model = context.model;
  const bool failed = model.finished() && !model.snapshot().error.empty();
  ImGui::AlignTextToFramePadding();
  const ImU32 colour = failed ? theme::kStop : model.running() ? theme::kGo : theme::kAccent;
  ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colour), "%s", model.state_text().c_str());
  char text[96];
  int n =
      std::snprintf(text, sizeof text, "tick %llu", static_cast<unsigned long long>(model.snapshot().ticks));
  if (model.snapshot().time_s)
    n += std::snprintf(text + n, sizeof text - n, "   %.2f s", *model.snapshot().time_s);
  if (model.running() && model.ticks_per_s() > 0.0)
    std::snprintf(text + n, sizeof text - n, "   %.0f ticks/s", model.ticks_per_s());
  const float width = ImGui::CalcTextSize(text).x;
  ImGui::SameLine();
  const float available = ImGui::GetContentRegionAvail().x;
  if (available < width) return ImGui::NewLine();
  ImGui::SetCursorPosX(ImGui::GetCursorPosX() + available - width);
  ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(theme::kFaint), "%s", text);
}

void draw_messages(DrawContext& context) {
  ViewModel& model = context.model;
  const std::string& error =
      model.finished() && !model.snapshot().error.empty() ? model.snapshot().error : model.notice;
  if (error.empty()) return;
  ImGui::PushStyleColor(ImGuiCol_Text, theme::kStop);
  ImGui::TextWrapped("%s", error.c_str());
  ImGui::PopStyleColor();
}

}  // namespace

void draw_toolbar(DrawContext& context) {
  ViewModel& model = context.model;
  const bool finished = model.finished(), running = model.running();
  const float button_width = context.to_pixels(72);
  ImGui::PushStyleColor(ImGuiCol_Text, running ? theme::kStop : theme::kGo);
  ImGui::BeginDisabled(finished);
  if (ImGui::Button(running ? "\u25a0  Stop" : "\u25b6  Run", {button_width, 0.0F})) model.toggle_running();
  ImGui::EndDisabled();
  ImGui::PopStyleColor();
  draw_tooltip("Run, or stop at the end of the tick (Space, F5)");
  same_line_gap(context);
  using debugger::StepUnit;
  const bool paused = !finished && !running;
  if (toolbar_button("Tick", "To the next surface.step (\u2192)", paused)) model.step(StepUnit::kTick);
  if (toolbar_button("Line", "To the next visible line (\u2193)", paused)) model.step(StepUnit::kLine);
  if (toolbar_button("Instruction", "One VM instruction (I)", paused)) model.step(StepUnit::kInstruction);
  if (toolbar_button("Walk", "Line by line or tick by tick, slowly (W)", paused)) model.walk();
  ImGui::SetNextItemWidth(context.to_pixels(44));
  ImGui::SliderInt("##pace", &model.steps_per_s, 1, 30, "%d");
  draw_tooltip("Walking speed");
  ImGui::SameLine(0.0F, context.to_pixels(2));
  if (ImGui::Button(model.walk_by_tick ? "ticks/s" : "lines/s")) model.walk_by_tick = !model.walk_by_tick;
  draw_tooltip("Walk by line or by tick");
  same_line_gap(context);
  if (toolbar_button("Reset", "Restart the program (R)")) model.reset();
  if (toolbar_button("Reload", "Reload the program; automatic when the file is saved"))
    model.reload_requested = true;
  if (toolbar_button("?", "Mouse and keys (F1)")) model.help_shown = !model.help_shown;
  if (is_wide_layout(context))
    same_line_gap(context);
  else
    ImGui::NewLine();
  draw_state(context);
  draw_messages(context);
}

namespace {

// GLFW's code of a key, and ours.
struct KeyMapping {
  int native, code;
};

const std::vector<KeyMapping>& key_mappings() {
  static const std::vector<KeyMapping> mappings = [] {
    std::vector<KeyMapping> keys = {{ImGui::GetKeyIndex(ImGuiKey_LeftArrow), program::kLeftKey},
                                    {ImGui::GetKeyIndex(ImGuiKey_UpArrow), program::kUpKey},
                                    {ImGui::GetKeyIndex(ImGuiKey_RightArrow), program::kRightKey},
                                    {ImGui::GetKeyIndex(ImGuiKey_DownArrow), program::kDownKey},
                                    {ImGui::GetKeyIndex(ImGuiKey_Enter), '\r'},
                                    {ImGui::GetKeyIndex(ImGuiKey_Tab), '\t'},
                                    {ImGui::GetKeyIndex(ImGuiKey_Escape), 27},
                                    {ImGui::GetKeyIndex(ImGuiKey_Backspace), 8}};
    for (int key = ' '; key <= '`'; ++key) keys.push_back({key, std::tolower(key)});  // GLFW uses ASCII here
    return keys;
  }();
  return mappings;
}

void pass_keys_to_program(ViewModel& model) {
  for (const KeyMapping& key : key_mappings()) {
    if (ImGui::IsKeyPressed(key.native, false)) model.press_key(key.code);
    if (ImGui::IsKeyReleased(key.native)) model.release_key(key.code);
  }
}

}  // namespace

void handle_keys(ViewModel& model) {
  ImGuiIO& io = ImGui::GetIO();
  constexpr int kF5 = 294, kF9 = 298;  // GLFW's codes
  if (ImGui::IsKeyPressed(kF9, false)) model.emergency_stop_requested = true;
  if (ImGui::IsKeyPressed(kF5, false) && !model.finished()) model.toggle_running();
  if (io.KeyCtrl && ImGui::IsKeyPressed('F', false) && !model.takes_keys()) model.focus_search = true;
  if (io.KeyCtrl && ImGui::IsKeyPressed('E', false) && !model.takes_keys())
    model.editor.shown = !model.editor.shown;
  if (io.WantTextInput || !model.takes_keys()) model.release_all_keys();
  if (io.WantTextInput) return;
  if (model.takes_keys()) return pass_keys_to_program(model);
  const auto pressed = [](ImGuiKey key, bool repeat) {
    return ImGui::IsKeyPressed(ImGui::GetKeyIndex(key), repeat);
  };
  const bool paused = !model.running() && !model.finished();
  if (pressed(ImGuiKey_Space, false) && !model.finished()) model.toggle_running();
  if (pressed(ImGuiKey_Escape, false)) model.help_shown = false;
  if (paused && pressed(ImGuiKey_RightArrow, true)) model.step(debugger::StepUnit::kTick);
  if (paused && pressed(ImGuiKey_DownArrow, true)) model.step(debugger::StepUnit::kLine);
  for (const ImWchar typed : io.InputQueueCharacters) {
    const int key = typed < 128 ? std::tolower(static_cast<int>(typed)) : 0;
    if (key == 'i' && paused) model.step(debugger::StepUnit::kInstruction);
    if (key == 'w' && paused) model.walk();
    if (key == 'r') model.reset();
    if (key == '?') model.help_shown = !model.help_shown;
  }
}

void draw_help(DrawContext& context) {
  static constexpr const char* kHelp[][2] = {
      {"Space   F5", "run, or stop at the end of the tick"},
      {"\u2192   \u2193   I", "one tick, one line, one instruction"},
      {"W", "walk, line by line or tick by tick"},
      {"Other keys", "io.key, while a program that reads it runs"},
      {"R", "reset"},
      {"Ctrl-F", "find in the program, or go to a line"},
      {"F9", "emergency stop of the boards, if the surface is a bridge's"},
      {"Ctrl-E   Ctrl-S", "edit the program, save and restart it"},
      {"Drag between two panes", "resize; double click: default"},
      {"Click a small register", "show it large"},
      {"Wheel, drag on the large one", "zoom, pan; double click: fit"},
      {"Click on the large one", "probe that cell"},
      {"Click left of a line's number", "breakpoint"},
      {"Click a triangle", "fold or unfold an include or a macro"},
      {"F1   ?   Esc", "this help"}};
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2.0F, size.y / 2.0F}, ImGuiCond_Always, {0.5F, 0.5F});
  ImGui::SetNextWindowFocus();
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {context.to_pixels(18), context.to_pixels(14)});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, context.to_pixels(8));
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
  if (ImGui::IsMouseClicked(0) && !ImGui::IsWindowHovered()) context.model.help_shown = false;
  ImGui::End();
  ImGui::PopStyleColor();
  ImGui::PopStyleVar(2);
}

}  // namespace apron::ui
