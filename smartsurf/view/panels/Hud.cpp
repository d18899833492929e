#include "smartsurf/view/panels/Hud.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "common/files/Installation.h"
#include "smartsurf/view/model/Axes.h"
#include "smartsurf/view/panels/Icons.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

constexpr float kFontSize_px = 14.0f, kTitleSize_px = 20.0f;
constexpr ImGuiWindowFlags kDockFlags =
    ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
    ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
    ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoBringToFrontOnFocus;

ImVec4 tone_colour(Banner::Tone tone) {
  switch (tone) {
    case Banner::Tone::kSuccess:
      return {0.05f, 0.45f, 0.20f, 1.0f};
    case Banner::Tone::kFailure:
      return {0.72f, 0.12f, 0.10f, 1.0f};
    case Banner::Tone::kNeutral:
      break;
  }
  return ImGui::GetStyle().Colors[ImGuiCol_Text];
}

// How the run ended, or what it waits for: a strip above the scene. Lines that fit stand side by side.
void draw_message(const Banner& banner, const Status& status, const DockRect& area, HudState& state,
                  Controls& controls, float scale) {
  begin_dock("message", area);
  ImGui::PushTextWrapPos(0.0f);
  ImGui::PushStyleColor(ImGuiCol_Text, tone_colour(banner.tone));
  ImGui::PushFont(ImGui::GetIO().Fonts->Fonts.back());  // of setup_imgui_style()
  ImGui::TextUnformatted(banner.title.c_str());
  ImGui::PopFont();
  ImGui::PopStyleColor();
  const float gap = 28.0f * scale;
  float end = 1e9f;
  for (const std::string& line : banner.lines) {
    if (end + gap + ImGui::CalcTextSize(line.c_str()).x < ImGui::GetWindowContentRegionMax().x)
      ImGui::SameLine(0.0f, gap);
    ImGui::TextUnformatted(line.c_str());
    end = ImGui::GetItemRectMax().x - ImGui::GetWindowPos().x;
  }
  if (!banner.command.empty()) {
    if (!banner.program.empty()) {
      if (icon_button(Icon::kRun, "Start it", ("start " + banner.program).c_str())) controls.start_program();
      ImGui::SameLine();
    }
    if (ImGui::Button("Copy")) ImGui::SetClipboardText(banner.command.c_str());
    ImGui::SameLine();
    ImGui::AlignTextToFramePadding();
    ImGui::TextColored({0.05f, 0.25f, 0.55f, 1.0f}, "%s", banner.command.c_str());
  } else if (status.can_reset && icon_button(Icon::kRestart, "Restart", "Restart: Backspace")) {
    controls.perform(UiAction::kReset, status);
  }
  ImGui::PopTextWrapPos();
  state.message_height =
      ImGui::GetCursorPosY() - ImGui::GetStyle().ItemSpacing.y + ImGui::GetStyle().WindowPadding.y;
  ImGui::End();
}

// The boundary of a dock, at `at` points along the axis; dragging it sets `size`, a double click restores the
// default. size_at: the size that puts it under the pointer, pixels.
template <class SizeAt>
void draw_splitter(const char* name, const DockRect& dock, bool vertical, float at, float& size, float scale,
                   SizeAt size_at) {
  if (dock.empty()) return;
  const float grip = 8.0f * scale;
  const ImVec2 corner = vertical ? ImVec2(at - 0.5f * grip, dock.y) : ImVec2(dock.x, at - 0.5f * grip);
  const ImVec2 extent = vertical ? ImVec2(grip, dock.height) : ImVec2(dock.width, grip);
  ImGui::SetNextWindowPos(corner);
  ImGui::SetNextWindowSize(extent);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0.0f, 0.0f});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, {1.0f, 1.0f});
  ImGui::Begin(name, nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
                   ImGuiWindowFlags_NoNav);
  ImGui::InvisibleButton("grip", extent);
  const bool active = ImGui::IsItemActive();
  if (active || ImGui::IsItemHovered()) {
    ImGui::SetMouseCursor(vertical ? ImGuiMouseCursor_ResizeEW : ImGuiMouseCursor_ResizeNS);
    const ImVec2 from = vertical ? ImVec2(at, corner.y) : ImVec2(corner.x, at),
                 to = vertical ? ImVec2(at, corner.y + extent.y) : ImVec2(corner.x + extent.x, at);
    ImGui::GetForegroundDrawList()->AddLine(from, to, IM_COL32(41, 107, 184, 255), 2.0f * scale);
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left))
      size = 0.0f;
    else if (active && ImGui::IsMouseDragging(ImGuiMouseButton_Left, 1.0f))
      size = std::max(1.0f, size_at(vertical ? mouse.x : mouse.y) / scale);
  }
  ImGui::End();
  ImGui::PopStyleVar(2);
}

void draw_splitters(const DockLayout& docks, DockSizes& sizes, float scale) {
  const float width = ImGui::GetIO().DisplaySize.x;
  if (docks.tall)
    draw_splitter("|top", docks.main, false, docks.main.bottom(), sizes.top, scale,
                  [](float y) { return y; });
  else
    draw_splitter("|side", docks.main, true, docks.main.right(), sizes.side, scale,
                  [](float x) { return x; });
  draw_splitter("|inspector", docks.inspector, true, docks.inspector.x, sizes.inspector, scale,
                [&](float x) { return width - x; });
  draw_splitter("|plots", docks.plots, false, docks.plots.y, sizes.plots, scale,
                [&](float y) { return docks.plots.bottom() - y; });
}

}  // namespace

void begin_dock(const char* name, const DockRect& area, bool scrolls) {
  ImGui::SetNextWindowPos({area.x, area.y});
  ImGui::SetNextWindowSize({area.width, area.height});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0.0f);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1.0f);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, {1.0f, 1.0f});
  ImGui::Begin(
      name, nullptr,
      scrolls ? kDockFlags : kDockFlags | ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse);
  ImGui::PopStyleVar(3);
}

void setup_imgui_style(float scale) {
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  // Without it, ImGui's built-in bitmap font is used.
  if (const std::string font = common::font_file("DejaVuSans.ttf").string(); !font.empty()) {
    io.Fonts->AddFontFromFileTTF(font.c_str(), kFontSize_px * scale, nullptr, common::kGlyphRanges);
    io.Fonts->AddFontFromFileTTF(font.c_str(), kTitleSize_px * scale, nullptr, common::kGlyphRanges);
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
  style.FrameBorderSize = 1.0f;
  style.Colors[ImGuiCol_Border] = {0.70f, 0.74f, 0.79f, 1.0f};
  style.Colors[ImGuiCol_Text] = {0.10f, 0.12f, 0.15f, 1.0f};
  style.Colors[ImGuiCol_WindowBg] = {0.97f, 0.98f, 0.99f, 1.0f};
  style.Colors[ImGuiCol_FrameBg] = {0.87f, 0.90f, 0.93f, 1.0f};
  style.Colors[ImGuiCol_Button] = {0.84f, 0.87f, 0.91f, 1.0f};
  style.ScaleAllSizes(scale);
}

void draw_hud(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
              const Overlay& overlay, HudState& state, Controls& controls, float scale) {
  const DockLayout docks = state.docks;
  if (!docks.main.empty()) {
    draw_main_panel(input, status, surface, overlay, docks.main, state, controls, scale);
    draw_bar(status, docks.bar, state, controls, scale);
  }
  if (ImGui::GetDragDropPayload() && !controls.plots_shown()) controls.perform(UiAction::kPlots, status);
  if (!docks.plots.empty()) draw_plots_panel(input, status, docks.plots, state, controls);
  if (!docks.inspector.empty())
    draw_inspector_panel(input, status, surface, docks.inspector, state, controls, scale);
  if (!docks.message.empty() && status.banner)
    draw_message(*status.banner, status, docks.message, state, controls, scale);
  draw_splitters(docks, state.sizes, scale);
}

void draw_help_overlay(float scale) {
  static constexpr const char* kHelp[][2] = {{"Left drag", "orbit"},
                                             {"Right or middle drag, Shift + left", "pan"},
                                             {"Wheel", "zoom"},
                                             {"Click", "pick an object or a cell"},
                                             {"Ctrl + drag", "pull an object with a spring"},
                                             {"1   2   3", "top view, whole table, side view"},
                                             {"Space", "pause, resume"},
                                             {"Left, right arrow", "one tick back, forward"},
                                             {"+   -   M", "faster, slower, as fast as possible"},
                                             {"Backspace", "restart"},
                                             {"W   G", "wireframe, grid"},
                                             {"T   F   S   L", "trails, forces, sensors, labels"},
                                             {"C", "colour the cells by the next channel"},
                                             {"O   P", "list of objects, plots"},
                                             {"Ctrl + C   Ctrl + V", "copy, paste the camera"},
                                             {"F12   V", "screenshot, video"},
                                             {"Tab   F1", "panels, this help"},
                                             {"F9", "emergency stop of all bridges to hardware"},
                                             {"Esc", "cancel the tool or selection, stop following"},
                                             {"Q", "quit"}};
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2.0f, size.y / 2.0f}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("help", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
                   ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoInputs);
  ImGui::TextUnformatted("Mouse and keys");
  ImGui::Dummy({0.0f, 4.0f * scale});
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const auto& line : kHelp) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(line[0]);
      ImGui::TableNextColumn();
      ImGui::TextDisabled("%s", line[1]);
    }
    ImGui::EndTable();
  }
  ImGui::End();
}

void draw_object_labels(const FrameInput& input, const Camera& camera, const DockRect& area) {
  constexpr std::size_t kMaxLabels = 1000;
  constexpr ImU32 kInk = IM_COL32(25, 30, 38, 255), kHalo = IM_COL32(255, 255, 255, 190);
  static const ImVec2 kHaloOffsets[] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
  const scene::Snapshot& snapshot = input.snapshot;
  for (std::size_t i = 0; i < std::min(snapshot.object_count(), kMaxLabels); ++i) {
    const scene::ObjectSpec& object = input.catalogue[snapshot.id[i]];
    const auto& p = snapshot.position[i];
    const Eigen::Vector3d top(p[0], p[1], p[2] + object.half_extents().maxCoeff());
    const Eigen::Vector3d screen = camera.project(top, area.width, area.height);
    if (!(screen.z() > 0.0)) continue;
    const std::string text = object.label.empty() ? std::to_string(snapshot.id[i])
                                                  : object.label + " " + std::to_string(snapshot.id[i]);
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    const ImVec2 corner(area.x + static_cast<float>(screen.x()) - size.x / 2.0f,
                        area.y + static_cast<float>(screen.y()) - size.y);
    ImDrawList* const draw_list = ImGui::GetBackgroundDrawList();
    for (const ImVec2& side : kHaloOffsets)
      draw_list->AddText({corner.x + side.x, corner.y + side.y}, kHalo, text.c_str());
    draw_list->AddText(corner, kInk, text.c_str());
  }
}

bool is_over_panel(double x, double y) {
  const ImVec2 at(static_cast<float>(x), static_cast<float>(y));
  for (const ImGuiWindow* window : ImGui::GetCurrentContext()->Windows)
    if (window->Active && (window->Flags & ImGuiWindowFlags_NoMouseInputs) == 0 &&
        window->Rect().Contains(at))
      return true;
  return false;
}

void draw_axis_labels(const scene::SurfaceSpec& surface, const Camera& camera, const DockRect& area) {
  const Axes axes = make_axes(surface);
  static constexpr const char* kNames[3] = {"x", "y", "z"};
  static constexpr ImU32 kColours[3] = {IM_COL32(190, 40, 35, 255), IM_COL32(35, 130, 50, 255),
                                        IM_COL32(35, 75, 195, 255)};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d tip = axes.origin + 1.12 * axes.length * Eigen::Vector3d::Unit(i);
    const Eigen::Vector3d screen = camera.project(tip, area.width, area.height);
    if (screen.z() <= 0.0) continue;
    const ImVec2 half = ImGui::CalcTextSize(kNames[i]);
    ImGui::GetBackgroundDrawList()->AddText({area.x + static_cast<float>(screen.x()) - half.x / 2.0f,
                                             area.y + static_cast<float>(screen.y()) - half.y / 2.0f},
                                            kColours[i], kNames[i]);
  }
}

}  // namespace smartsurf::view
