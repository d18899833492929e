#include "smartsurf/view/Hud.h"

#include <imgui.h>

#include <cstdio>
#include <filesystem>

#include "smartsurf/view/Axes.h"

namespace smartsurf::view {
namespace {

// Debian's fonts-dejavu-core; without it ImGui's own bitmap font serves.
constexpr const char* kFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr float kFontPixels = 14.0f;
constexpr ImGuiWindowFlags kPanel = ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                                    ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
                                    ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoMove;
const ImVec4 kFaint(0.36f, 0.40f, 0.46f, 1.0f);

std::string pace_text(double pace) {
  char text[32];
  if (pace <= 0.0) return "max";
  if (pace < 1.0) std::snprintf(text, sizeof(text), "1/%.3g×", 1.0 / pace);
  else std::snprintf(text, sizeof(text), "%.3g×", pace);
  return text;
}

template <class... Values>
void row(const char* name, const char* format, Values... values) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextColored(kFaint, "%s", name);
  ImGui::TableNextColumn();
  ImGui::Text(format, values...);
}

void state_rows(const scene::Snapshot& snapshot, const Status& status, const HudState& state) {
  row("time", "%.2f s", snapshot.time_s);
  row("tick", "%llu", static_cast<unsigned long long>(snapshot.tick));
  row("speed", "%.2f×  of  %s", status.actual_pace, pace_text(status.requested_pace).c_str());
  if (!status.mode.empty()) row("mode", "%s", status.mode.c_str());
  row("controller", "%s", status.controller.empty() ? "none" : status.controller.c_str());
  row("objects", "%zu", snapshot.objects());
  row("contacts", "%u", snapshot.contacts);
  if (status.purity) row("purity", "%.3f", *status.purity);
  row("physics", "%.2f ms a tick", status.physics_ms);
  row("drawing", "%.1f ms a frame", state.render_ms);
}

void buttons(const Status& status, Controls& controls) {
  if (ImGui::Button(status.paused ? "Run" : "Pause")) controls.press(Key::kPause, status);
  ImGui::SameLine();
  if (ImGui::Button("Step")) controls.press(Key::kStep, status);
  ImGui::SameLine();
  if (ImGui::Button("-")) controls.press(Key::kSlower, status);
  ImGui::SameLine();
  if (ImGui::Button("+")) controls.press(Key::kFaster, status);
  ImGui::SameLine();
  if (ImGui::Button(status.requested_pace > 0.0 ? "Max" : "1×")) controls.press(Key::kMaxPace, status);
}

}  // namespace

void set_up_hud(float scale) {
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  if (std::filesystem::exists(kFont)) {
    io.Fonts->AddFontFromFileTTF(kFont, kFontPixels * scale);
  } else {
    io.Fonts->AddFontDefault();
    io.FontGlobalScale = scale;
  }
  ImGui::StyleColorsLight();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = 6.0f;
  style.FrameRounding = 4.0f;
  style.WindowPadding = {12.0f, 10.0f};
  style.CellPadding = {6.0f, 1.5f};
  style.WindowBorderSize = 0.0f;
  style.Colors[ImGuiCol_Text] = {0.10f, 0.12f, 0.15f, 1.0f};
  style.Colors[ImGuiCol_WindowBg] = {0.97f, 0.98f, 0.99f, 1.0f};
  style.Colors[ImGuiCol_Button] = {0.84f, 0.87f, 0.91f, 1.0f};
  style.ScaleAllSizes(scale);
}

void draw_hud(const scene::Snapshot& snapshot, const Status& status, const HudState& state, Controls& controls,
              float scale) {
  ImGui::SetNextWindowPos({12.0f * scale, 12.0f * scale});
  ImGui::SetNextWindowBgAlpha(0.82f);
  ImGui::Begin("run", nullptr, kPanel);
  if (ImGui::BeginTable("state", 2, ImGuiTableFlags_SizingFixedFit)) {
    state_rows(snapshot, status, state);
    ImGui::EndTable();
  }
  ImGui::Spacing();
  buttons(status, controls);
  if (!state.message.empty()) ImGui::TextUnformatted(state.message.c_str());
  ImGui::TextColored(kFaint, "F1: help");
  ImGui::End();
  if (!status.paused) return;
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x / 2.0f, 12.0f * scale}, ImGuiCond_Always, {0.5f, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.82f);
  ImGui::Begin("paused", nullptr, kPanel | ImGuiWindowFlags_NoInputs);
  ImGui::TextUnformatted("Paused");
  ImGui::End();
}

void draw_help(float scale) {
  static constexpr const char* kHelp[][2] = {
      {"Left drag", "turn"},
      {"Right or middle drag, Shift + left", "move"},
      {"Wheel", "zoom"},
      {"1   2   3", "from above, whole table, from the side"},
      {"Space", "pause and run"},
      {"Right arrow", "one tick, when paused"},
      {"+   -", "faster, slower"},
      {"M", "as fast as possible, and back to real time"},
      {"W", "objects as wires"},
      {"G", "grid"},
      {"P", "write a picture"},
      {"F1", "this help"},
      {"Esc   Q", "quit"}};
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2.0f, size.y / 2.0f}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("help", nullptr, kPanel | ImGuiWindowFlags_NoInputs);
  ImGui::TextUnformatted("Mouse and keys");
  ImGui::Dummy({0.0f, 4.0f * scale});
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const auto& line : kHelp) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(line[0]);
      ImGui::TableNextColumn();
      ImGui::TextColored(kFaint, "%s", line[1]);
    }
    ImGui::EndTable();
  }
  ImGui::End();
}

void draw_axis_names(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height) {
  const Axes axes = axes_of(surface);
  static constexpr const char* kNames[3] = {"x", "y", "z"};
  static constexpr ImU32 kColours[3] = {IM_COL32(190, 40, 35, 255), IM_COL32(35, 130, 50, 255),
                                        IM_COL32(35, 75, 195, 255)};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d tip = axes.origin + 1.12 * axes.length * Eigen::Vector3d::Unit(i);
    const Eigen::Vector3d at = camera.project(tip, width, height);
    if (at.z() <= 0.0) continue;
    const ImVec2 half = ImGui::CalcTextSize(kNames[i]);
    ImGui::GetBackgroundDrawList()->AddText(
        {static_cast<float>(at.x()) - half.x / 2.0f, static_cast<float>(at.y()) - half.y / 2.0f}, kColours[i],
        kNames[i]);
  }
}

}  // namespace smartsurf::view
