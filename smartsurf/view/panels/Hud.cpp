#include "smartsurf/view/panels/Hud.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>

#include "smartsurf/view/model/Axes.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

// Debian's fonts-dejavu-core; without it ImGui's own bitmap font serves.
constexpr const char* kFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr float kFontPixels = 14.0f;
constexpr ImGuiWindowFlags kPanel = ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                                    ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
                                    ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoMove;
const ImVec4 kFaint(0.36f, 0.40f, 0.46f, 1.0f), kWarning(0.75f, 0.25f, 0.05f, 1.0f);

std::string pace_text(double pace) {
  char text[32];
  if (pace <= 0.0) return "max";
  if (pace < 1.0)
    std::snprintf(text, sizeof(text), "1/%.3g×", 1.0 / pace);
  else
    std::snprintf(text, sizeof(text), "%.3g×", pace);
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
  if (!status.controller.empty()) row("controller", "%s", status.controller.c_str());
  row("objects", "%zu", snapshot.object_count());
  row("contacts", "%u", snapshot.contact_count);
  if (status.purity) row("purity", "%.3f", *status.purity);
  if (status.physics_ms > 0.0) row("physics", "%.2f ms a tick", status.physics_ms);
  row("drawing", "%.1f ms, %.0f frames/s", state.render_ms, 1000.0 / std::max(state.interval_ms, 1.0));
}

void button(const char* label, Key key, const Status& status, Controls& controls, const char* tip) {
  if (ImGui::Button(label)) controls.press(key, status);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", tip);
}

void buttons(const Status& status, Controls& controls) {
  button(status.paused ? "Run" : "Pause", Key::kPause, status, controls, "Space");
  ImGui::SameLine();
  button("Step", Key::kStep, status, controls, "Right arrow");
  ImGui::SameLine();
  button("-", Key::kSlower, status, controls, "slower: -");
  ImGui::SameLine();
  button("+", Key::kFaster, status, controls, "faster: +");
  ImGui::SameLine();
  button(status.requested_pace > 0.0 ? "Max" : "1×", Key::kMaxPace, status, controls, "M");
  if (!status.resettable) return;
  ImGui::SameLine();
  button("Reset", Key::kReset, status, controls, "begin anew: Backspace");
}

// Along the bottom: where on the timeline the picture stands, and the way to elsewhere on it.
// Returns the y of its upper edge.
float draw_timeline(const Timeline& line, const Status& status, Controls& controls, float scale) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float width = size.x - 24.0f * scale;
  ImGui::SetNextWindowPos({12.0f * scale, size.y - 12.0f * scale}, ImGuiCond_Always, {0.0f, 1.0f});
  ImGui::SetNextWindowSize({width, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.82f);
  ImGui::Begin("timeline", nullptr, kPanel);
  if (ImGui::Button(status.paused ? "Play" : "Pause")) controls.press(Key::kPause, status);
  ImGui::SameLine();
  if (ImGui::ArrowButton("back", ImGuiDir_Left)) controls.press(Key::kStepBack, status);
  ImGui::SameLine();
  if (ImGui::ArrowButton("forward", ImGuiDir_Right)) controls.press(Key::kStep, status);
  ImGui::SameLine();
  char end[48];
  std::snprintf(end, sizeof(end), line.recorded ? "%.2f s" : "now: %.2f s", line.end_s);
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%.2f s", line.begin_s);
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-ImGui::CalcTextSize(end).x - 2.0f * ImGui::GetStyle().ItemSpacing.x);
  int frame = static_cast<int>(line.frame);
  if (ImGui::SliderInt("##frame", &frame, 0, static_cast<int>(line.frames) - 1, "frame %d",
                       ImGuiSliderFlags_AlwaysClamp))
    controls.seek(static_cast<std::size_t>(frame));
  ImGui::SameLine();
  ImGui::TextUnformatted(end);
  const float top = ImGui::GetWindowPos().y;
  ImGui::End();
  return top;
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
  style.Colors[ImGuiCol_FrameBg] = {0.87f, 0.90f, 0.93f, 1.0f};
  style.Colors[ImGuiCol_Button] = {0.84f, 0.87f, 0.91f, 1.0f};
  style.ScaleAllSizes(scale);
}

namespace {

void draw_run_panel(const FrameInput& moment, const Status& status, HudState& state, Controls& controls,
                    float scale) {
  ImGui::SetNextWindowPos({12.0f * scale, 12.0f * scale});
  ImGui::SetNextWindowBgAlpha(0.86f);
  ImGui::Begin("run", nullptr, kPanel);
  ImGui::PushItemWidth(150.0f * scale);
  if (ImGui::BeginTable("state", 2, ImGuiTableFlags_SizingFixedFit)) {
    state_rows(moment.snapshot, status, state);
    ImGui::EndTable();
  }
  ImGui::Spacing();
  buttons(status, controls);
  draw_visibility_section(moment, status, controls);
  draw_tools_section(status, controls);
  draw_options_section(status, state.edits, controls);
  if (!status.notice.empty()) ImGui::TextColored(kWarning, "%s", status.notice.c_str());
  if (state.filming) ImGui::TextColored(kWarning, "filming; V ends it");
  if (!state.message.empty()) ImGui::TextUnformatted(state.message.c_str());
  ImGui::TextColored(kFaint, "F1: help   Tab: hide panels");
  ImGui::PopItemWidth();
  // At its first size: the scene does not move whenever a section is opened.
  if (state.covered.above == 0.0 && !ImGui::IsWindowAppearing())
    state.covered.above =
        std::min(0.4, static_cast<double>((ImGui::GetWindowPos().y + ImGui::GetWindowSize().y) /
                                          ImGui::GetIO().DisplaySize.y));
  ImGui::End();
}

void draw_paused(float scale) {
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x / 2.0f, 12.0f * scale}, ImGuiCond_Always,
                          {0.5f, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.82f);
  ImGui::Begin("paused", nullptr, kPanel | ImGuiWindowFlags_NoInputs);
  ImGui::TextUnformatted("Paused");
  ImGui::End();
}

}  // namespace

void draw_hud(const FrameInput& moment, const Status& status, const std::optional<HeatScale>& heat,
              HudState& state, Controls& controls, float scale) {
  float bottom = ImGui::GetIO().DisplaySize.y - 12.0f * scale;
  if (controls.panels_shown()) {
    draw_run_panel(moment, status, state, controls, scale);
    draw_inspect_panel(moment, state.watch, controls, scale);
    if (status.timeline) {
      const float top = draw_timeline(*status.timeline, status, controls, scale);
      bottom = top - 8.0f * scale;
      state.covered.below = std::min(0.4, 1.0 - static_cast<double>(top / ImGui::GetIO().DisplaySize.y));
    }
    if (status.paused) draw_paused(scale);
  }
  if (heat) draw_legend(*heat, bottom, scale);
}

void draw_help(float scale) {
  static constexpr const char* kHelp[][2] = {
      {"Left drag", "turn"},
      {"Right or middle drag, Shift + left", "move"},
      {"Wheel", "zoom"},
      {"Click", "pick an object or a cell"},
      {"Ctrl + drag", "pull an object with a spring"},
      {"1   2   3", "from above, whole table, from the side"},
      {"Space", "pause and run"},
      {"Left, right arrow", "one tick back, on"},
      {"+   -   M", "faster, slower, as fast as possible"},
      {"Backspace", "begin anew"},
      {"W   G", "objects as wires, grid"},
      {"H", "next channel on the cells"},
      {"T   F   S   L", "trails, contact forces, what the sensors see, labels"},
      {"O", "follow the picked object"},
      {"P   V", "write a picture, a video"},
      {"Tab   F1", "panels, this help"},
      {"Esc", "put down the tool, free the camera"},
      {"Q", "quit"}};
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

void draw_labels(const FrameInput& moment, const Camera& camera, float width, float height) {
  constexpr std::size_t kMostLabels = 1000;
  constexpr ImU32 kInk = IM_COL32(25, 30, 38, 255), kHalo = IM_COL32(255, 255, 255, 190);
  static const ImVec2 kAround[] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
  const scene::Snapshot& snapshot = moment.snapshot;
  for (std::size_t i = 0; i < std::min(snapshot.object_count(), kMostLabels); ++i) {
    const scene::ObjectSpec& object = moment.catalogue[snapshot.id[i]];
    const auto& p = snapshot.position[i];
    const Eigen::Vector3d top(p[0], p[1], p[2] + object.half_extents().maxCoeff());
    const Eigen::Vector3d at = camera.project(top, width, height);
    if (!(at.z() > 0.0)) continue;
    const std::string text = object.label.empty() ? std::to_string(snapshot.id[i])
                                                  : object.label + " " + std::to_string(snapshot.id[i]);
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    const ImVec2 corner(static_cast<float>(at.x()) - size.x / 2.0f, static_cast<float>(at.y()) - size.y);
    ImDrawList* const paper = ImGui::GetBackgroundDrawList();
    for (const ImVec2& side : kAround)
      paper->AddText({corner.x + side.x, corner.y + side.y}, kHalo, text.c_str());
    paper->AddText(corner, kInk, text.c_str());
  }
}

bool over_panel(double x, double y) {
  const ImVec2 at(static_cast<float>(x), static_cast<float>(y));
  for (const ImGuiWindow* window : ImGui::GetCurrentContext()->Windows)
    if (window->Active && (window->Flags & ImGuiWindowFlags_NoMouseInputs) == 0 &&
        window->Rect().Contains(at))
      return true;
  return false;
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
