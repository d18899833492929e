#include "smartsurf/view/panels/Hud.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ranges>
#include <string>

#include "common/files/Installation.h"
#include "smartsurf/view/model/Axes.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

constexpr float kFontSize_px = 14.0f, kTitleSize_px = 20.0f;
constexpr float kPanelWidth = 270.0f;   // of the contents of the run panel, pixels, unscaled
constexpr std::size_t kMaxMetrics = 8;  // in the run panel
constexpr ImGuiWindowFlags kPanelFlags =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings |
    ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoMove;
const ImVec4 kDimTextColour(0.36f, 0.40f, 0.46f, 1.0f), kWarningColour(0.75f, 0.25f, 0.05f, 1.0f);

std::string format_pace(double pace) {
  char text[32];
  if (pace <= 0.0) return "max";
  if (pace < 1.0)
    std::snprintf(text, sizeof(text), "1/%.3g×", 1.0 / pace);
  else
    std::snprintf(text, sizeof(text), "%.3g×", pace);
  return text;
}

template <class... Values>
void table_row(const char* name, const char* format, Values... values) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextColored(kDimTextColour, "%s", name);
  ImGui::TableNextColumn();
  ImGui::Text(format, values...);
}

void draw_state_rows(const scene::Snapshot& snapshot, const Status& status, const HudState& state) {
  table_row("time", "%.2f s", snapshot.time_s);
  table_row("tick", "%llu", static_cast<unsigned long long>(snapshot.tick));
  if (status.paused)
    table_row("speed", "%s", status.run_ended ? "the run has ended" : "paused");
  else
    table_row("speed", "%.2f×  of  %s", status.actual_pace, format_pace(status.requested_pace).c_str());
  if (!status.mode.empty()) table_row("mode", "%s", status.mode.c_str());
  if (!status.controller.empty()) table_row("controller", "%s", status.controller.c_str());
  table_row("objects", "%zu", snapshot.object_count());
  table_row("contacts", "%u", snapshot.contact_count);
  for (const auto& [name, value] : status.metrics | std::views::take(kMaxMetrics))
    if (std::isfinite(value)) table_row(name.c_str(), "%.4g", value);
  if (status.physics_ms > 0.0) table_row("physics", "%.2f ms/tick", status.physics_ms);
  table_row("drawing", "%.1f ms, %.0f frames/s", state.render_ms, 1000.0 / std::max(state.interval_ms, 1.0));
}

void action_button(const char* label, UiAction action, const Status& status, Controls& controls,
                   const char* tooltip) {
  if (ImGui::Button(label)) controls.perform(action, status);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", tooltip);
}

// A disabled button has a tooltip, too, which says why.
void disabled_button(const char* label, const char* reason) {
  ImGui::BeginDisabled();
  ImGui::Button(label);
  ImGui::EndDisabled();
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) ImGui::SetTooltip("%s", reason);
}

void draw_transport_controls(const Status& status, Controls& controls) {
  if (status.run_ended) {
    if (status.can_reset)
      action_button("Run again", UiAction::kReset, status, controls, "from the start: Backspace");
    else
      disabled_button("Run again",
                      "a run that writes a recording, a video or pictures cannot run again here");
    return;
  }
  action_button(status.paused ? "Run" : "Pause", UiAction::kPause, status, controls, "Space");
  ImGui::SameLine();
  action_button("Step", UiAction::kStep, status, controls, "Right arrow");
  ImGui::SameLine();
  action_button("-", UiAction::kSlower, status, controls, "slower: -");
  ImGui::SameLine();
  action_button("+", UiAction::kFaster, status, controls, "faster: +");
  ImGui::SameLine();
  action_button(status.requested_pace > 0.0 ? "Max" : "1×", UiAction::kMaxPace, status, controls, "M");
  if (!status.can_reset) return;
  ImGui::SameLine();
  action_button("Reset", UiAction::kReset, status, controls, "restart: Backspace");
}

ImU32 mark_colour(EventMark::Kind kind) {
  switch (kind) {
    case EventMark::Kind::kSuccess:
      return IM_COL32(15, 125, 55, 255);
    case EventMark::Kind::kTouched:
      return IM_COL32(205, 95, 0, 255);
    case EventMark::Kind::kControllerLost:
      return IM_COL32(195, 25, 25, 255);
    case EventMark::Kind::kScript:
      break;
  }
  return IM_COL32(40, 95, 190, 255);
}

// Draws the marks under the slider from `low` to `high`; a click on one seeks to it.
void draw_event_marks(const Timeline& timeline, const ImVec2& low, const ImVec2& high, Controls& controls,
                      float scale) {
  const double span_s = timeline.end_s - timeline.begin_s;
  if (timeline.marks.empty() || span_s <= 0.0) return;
  const float size = 5.0f * scale, grab = ImGui::GetStyle().GrabMinSize / 2.0f;
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const EventMark* hovered = nullptr;
  float nearest = 1.5f * size;
  float drawn_at = -1e9f;
  EventMark::Kind drawn_kind{};
  for (const EventMark& mark : timeline.marks) {
    if (mark.time_s < timeline.begin_s || mark.time_s > timeline.end_s) continue;
    const float x =
        low.x + grab +
        static_cast<float>((mark.time_s - timeline.begin_s) / span_s) * (high.x - low.x - 2.0f * grab);
    const bool in_reach = mouse.y > high.y && mouse.y < high.y + 2.5f * size;
    if (in_reach && std::abs(mouse.x - x) < nearest) {
      nearest = std::abs(mouse.x - x);
      hovered = &mark;
    }
    if (mark.kind == drawn_kind && x - drawn_at < 1.0f) continue;
    drawn_at = x;
    drawn_kind = mark.kind;
    ImGui::GetWindowDrawList()->AddTriangleFilled({x, high.y + 1.0f}, {x - size, high.y + 2.0f * size},
                                                  {x + size, high.y + 2.0f * size}, mark_colour(mark.kind));
  }
  ImGui::SetCursorPosY(ImGui::GetCursorPosY() - ImGui::GetStyle().ItemSpacing.y);
  ImGui::Dummy({1.0f, 2.0f * size});
  if (!hovered) return;
  ImGui::SetTooltip("%.2f s: %s", hovered->time_s, hovered->text.c_str());
  if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) controls.seek_time(hovered->time_s);
}

// What can be switched on and off, highlighted while it is on, in two rows.
void draw_toggles(const Status& status, Controls& controls, float width) {
  struct Toggle {
    const char* label;
    UiAction action;
    const char* tooltip;
  };
  static constexpr Toggle kToggles[] = {
      {"wires", UiAction::kWireframe, "wireframe objects: W"},
      {"grid", UiAction::kGrid, "grid on the ground: G"},
      {"trails", UiAction::kTrails, "trails of the objects: T"},
      {"forces", UiAction::kContactForces, "contact forces: F"},
      {"sensors", UiAction::kSensorRays, "sensor rays: S"},
      {"labels", UiAction::kLabels, "labels of the objects: L"},
      {"cells", UiAction::kNextChannel, "colour the cells by the next channel: H"},
      {"follow", UiAction::kFollow, "follow the selected object: O"},
      {"list", UiAction::kEntities, "list of channels and objects: E"},
      {"plots", UiAction::kPlots, "plots of data over time: D"}};
  constexpr int kColumns = IM_ARRAYSIZE(kToggles) / 2;
  const float gap = 3.0f, button = (width - gap * (kColumns - 1)) / kColumns;
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {0.0f, ImGui::GetStyle().FramePadding.y});
  for (int i = 0; i < IM_ARRAYSIZE(kToggles); ++i) {
    const Toggle& toggle = kToggles[i];
    const bool on = controls.is_on(toggle.action);
    if (on) {
      ImGui::PushStyleColor(ImGuiCol_Button, {0.16f, 0.42f, 0.72f, 1.0f});
      ImGui::PushStyleColor(ImGuiCol_Text, {1.0f, 1.0f, 1.0f, 1.0f});
    }
    const bool pressed = ImGui::Button(toggle.label, {button, 0.0f});
    if (on) ImGui::PopStyleColor(2);
    if (pressed) controls.perform(toggle.action, status);
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s (%s)", toggle.tooltip, on ? "on" : "off");
    if (i % kColumns != kColumns - 1) ImGui::SameLine();
  }
  ImGui::PopStyleVar(2);
}

// Draws the timeline with its playback controls along the bottom. Returns the y of its upper edge.
float draw_timeline(const Timeline& timeline, const Status& status, Controls& controls, float scale) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float width = size.x - 24.0f * scale;
  ImGui::SetNextWindowPos({12.0f * scale, size.y - 12.0f * scale}, ImGuiCond_Always, {0.0f, 1.0f});
  ImGui::SetNextWindowSize({width, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.82f);
  ImGui::Begin("timeline", nullptr, kPanelFlags);
  if (status.run_ended)
    disabled_button("Play", "the run has ended; drag the slider or use the arrows to look back");
  else if (ImGui::Button(status.paused ? "Play" : "Pause"))
    controls.perform(UiAction::kPause, status);
  ImGui::SameLine();
  if (ImGui::ArrowButton("back", ImGuiDir_Left)) controls.perform(UiAction::kStepBack, status);
  ImGui::SameLine();
  if (ImGui::ArrowButton("forward", ImGuiDir_Right)) controls.perform(UiAction::kStep, status);
  ImGui::SameLine();
  char end_label[48];
  std::snprintf(end_label, sizeof(end_label), timeline.is_recording ? "%.2f s" : "now: %.2f s",
                timeline.end_s);
  ImGui::AlignTextToFramePadding();
  ImGui::Text("%.2f s", timeline.begin_s);
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-ImGui::CalcTextSize(end_label).x - 2.0f * ImGui::GetStyle().ItemSpacing.x);
  int frame = static_cast<int>(timeline.current_frame);
  if (ImGui::SliderInt("##frame", &frame, 0, static_cast<int>(timeline.frame_count) - 1, "frame %d",
                       ImGuiSliderFlags_AlwaysClamp))
    controls.seek(static_cast<std::size_t>(frame));
  const ImVec2 slider_low = ImGui::GetItemRectMin(), slider_high = ImGui::GetItemRectMax();
  ImGui::SameLine();
  ImGui::TextUnformatted(end_label);
  draw_event_marks(timeline, slider_low, slider_high, controls, scale);
  const float top = ImGui::GetWindowPos().y;
  ImGui::End();
  return top;
}

}  // namespace

void setup_imgui_style(float scale) {
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  // Without it, ImGui's built-in bitmap font is used.
  if (const std::string font = common::font_file("DejaVuSans.ttf").string(); !font.empty()) {
    io.Fonts->AddFontFromFileTTF(font.c_str(), kFontSize_px * scale);
    io.Fonts->AddFontFromFileTTF(font.c_str(), kTitleSize_px * scale);
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

namespace {

// Returns the lower right corner of the panel, pixels.
ImVec2 draw_run_panel(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
                      HudState& state, Controls& controls, float scale) {
  ImGui::SetNextWindowPos({12.0f * scale, 12.0f * scale});
  if (state.free_bottom > 0.0f)
    ImGui::SetNextWindowSizeConstraints({0.0f, 0.0f},
                                        {1e6f, std::max(state.free_bottom - 12.0f * scale, 100.0f * scale)});
  ImGui::SetNextWindowBgAlpha(0.86f);
  ImGui::Begin("run", nullptr, kPanelFlags & ~ImGuiWindowFlags_NoScrollbar);
  ImGui::PushItemWidth(150.0f * scale);
  if (ImGui::BeginTable("state", 2, ImGuiTableFlags_SizingFixedFit)) {
    draw_state_rows(input.snapshot, status, state);
    ImGui::EndTable();
  }
  ImGui::Spacing();
  draw_transport_controls(status, controls);
  draw_toggles(status, controls, kPanelWidth * scale);
  draw_visibility_section(input, status, controls);
  draw_tools_section(status, controls);
  draw_options_section(status, state.option_edits, controls);
  draw_entities_section(input, surface, state, controls);
  ImGui::PushTextWrapPos(kPanelWidth * scale);
  if (!status.notice.empty()) ImGui::TextColored(kWarningColour, "%s", status.notice.c_str());
  if (state.recording_video) ImGui::TextColored(kWarningColour, "recording video; V: stop");
  if (!state.message.empty()) ImGui::TextUnformatted(state.message.c_str());
  ImGui::PopTextWrapPos();
  ImGui::TextColored(kDimTextColour, "F1: help   Tab: hide panels");
  ImGui::PopItemWidth();
  const ImVec2 position = ImGui::GetWindowPos(), extent = ImGui::GetWindowSize();
  // Set once, from the panel's initial size, so that the scene does not move when a section is opened.
  if (state.insets.top == 0.0 && !ImGui::IsWindowAppearing()) {
    const ImVec2 display = ImGui::GetIO().DisplaySize;
    state.insets.top = std::min(0.4, static_cast<double>((position.y + extent.y) / display.y));
    state.insets.left = std::min(0.6, static_cast<double>((position.x + extent.x) / display.x));
  }
  ImGui::End();
  return {position.x + extent.x, position.y + extent.y};
}

// Beside a table that fills the window's height; in a narrow window, where the table is framed below the
// panels, beside the run panel and not lower; if they do not fit side by side, below it. panel: its lower
// right corner, pixels.
InspectorSpace inspector_space(const ImVec2& panel, const HudState& state, float bottom, float scale) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float top = 12.0f * scale, beside = display.x - panel.x - kInspectorWidth * scale;
  if (beside >= 300.0f * scale) return {top, bottom};
  if (beside >= 0.0f) return {top, static_cast<float>(state.insets.top) * display.y};
  const float below = panel.y + 8.0f * scale;
  return {below, below + 0.45f * (bottom - below)};
}

// In the middle between two panels. left, right: their edges, pixels.
void draw_paused_badge(float left, float right, float scale) {
  ImGui::SetNextWindowPos({(left + right) / 2.0f, 12.0f * scale}, ImGuiCond_Always, {0.5f, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.82f);
  ImGui::Begin("paused", nullptr, kPanelFlags | ImGuiWindowFlags_NoInputs);
  ImGui::TextUnformatted("Paused");
  ImGui::End();
}

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

// Draws the banner in the middle of the space beside the run panel, or below it where that is narrow: at the
// top if it asks for a command, at the bottom, in front of the table, if it is a result. panel: its lower
// right corner; right, bottom: where the space ends; pixels.
void draw_banner(const Banner& banner, const ImVec2& panel, float right, float bottom, float scale) {
  const bool beside = right - panel.x >= 420.0f * scale;
  const float left = beside ? panel.x : 0.0f, top = beside ? 0.0f : panel.y;
  const float space = (beside ? right : ImGui::GetIO().DisplaySize.x) - left;
  const float width = std::min(620.0f * scale, space - 48.0f * scale);
  const bool is_result = banner.command.empty();
  ImGui::SetNextWindowPos({left + space / 2.0f, is_result ? bottom : top + 12.0f * scale}, ImGuiCond_Always,
                          {0.5f, is_result ? 1.0f : 0.0f});
  ImGui::SetNextWindowBgAlpha(0.95f);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 2.0f * scale);
  ImGui::PushStyleColor(ImGuiCol_Border, tone_colour(banner.tone));
  ImGui::Begin("banner", nullptr, kPanelFlags);
  ImGui::PushTextWrapPos(width);
  ImGui::PushStyleColor(ImGuiCol_Text, tone_colour(banner.tone));
  ImGui::PushFont(ImGui::GetIO().Fonts->Fonts.back());  // of setup_imgui_style()
  ImGui::TextUnformatted(banner.title.c_str());
  ImGui::PopFont();
  ImGui::PopStyleColor();
  for (const std::string& line : banner.lines) ImGui::TextUnformatted(line.c_str());
  if (!banner.command.empty()) {
    ImGui::TextColored({0.05f, 0.25f, 0.55f, 1.0f}, "%s", banner.command.c_str());
    if (ImGui::Button("Copy")) ImGui::SetClipboardText(banner.command.c_str());
  }
  ImGui::PopTextWrapPos();
  ImGui::End();
  ImGui::PopStyleColor();
  ImGui::PopStyleVar();
}

// What is switched on and has nothing to show, in words; "": nothing.
std::string missing_lines(const FrameInput& input, const OverlaySettings& settings, const Status& status) {
  const char* const where = status.timeline && status.timeline->is_recording ? "in this recording" : "here";
  std::string missing;
  const bool has_rays = std::ranges::any_of(input.channels, [&](const Channel& channel) {
    return std::ranges::find(input.channels, channel.name + "_hit", &Channel::name) != input.channels.end();
  });
  if (settings.sensor_rays && !has_rays) missing += std::string("no distance sensors ") + where + "\n";
  if (settings.contact_forces && !status.has_contacts)
    missing += std::string("no contact forces ") + where + "\n";
  return missing;
}

}  // namespace

void draw_hud(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
              const Overlay& overlay, HudState& state, Controls& controls, float scale) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  float bottom = display.y - 12.0f * scale, inspector = display.x;
  ImVec2 panel(0.0f, 0.0f);
  state.insets.right = 0.0;
  if (controls.panels_shown()) {
    panel = draw_run_panel(input, status, surface, state, controls, scale);
    if (status.timeline) bottom = draw_timeline(*status.timeline, status, controls, scale) - 8.0f * scale;
    if (ImGui::GetDragDropPayload() && !controls.plots_shown()) controls.perform(UiAction::kPlots, status);
    if (controls.plots_shown())
      bottom = draw_plots_panel(input, status, state, controls, bottom, scale) - 8.0f * scale;
    if (status.timeline || controls.plots_shown())
      state.insets.bottom = std::min(0.4, 1.0 - static_cast<double>(bottom / display.y));
    const InspectorSpace space = inspector_space(panel, state, bottom, scale);
    inspector = draw_inspector_panel(input, status, surface, state, controls, space, scale);
    if (space.bottom == bottom)
      state.insets.right = std::min(0.4, 1.0 - static_cast<double>(inspector / display.x));
    if (status.paused && !status.banner && inspector - panel.x > 100.0f * scale)
      draw_paused_badge(panel.x, inspector, scale);
  }
  state.free_bottom = bottom;
  // The legends stand side by side, in a narrow window one above the other, and the banner of a result above
  // both.
  const bool narrow = display.x < 640.0f * scale;
  float right = display.x - 12.0f * scale, free_bottom = bottom;
  if (overlay.colour_scale()) {
    free_bottom = draw_legend(*overlay.colour_scale(), bottom, scale) - 8.0f * scale;
    if (!narrow) right -= 272.0f * scale;
  }
  const float lines_bottom = narrow ? free_bottom : bottom;
  const float lines_top =
      draw_line_legend(overlay.settings, overlay.force_scale(),
                       missing_lines(input, overlay.settings, status), right, lines_bottom, scale);
  if (lines_top < lines_bottom) free_bottom = std::min(free_bottom, lines_top - 8.0f * scale);
  if (status.banner) draw_banner(*status.banner, panel, inspector, free_bottom, scale);
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
                                             {"W   G", "wireframe objects, grid"},
                                             {"H", "colour the cells by the next channel"},
                                             {"T   F   S   L", "trails, contact forces, sensor rays, labels"},
                                             {"O", "follow the picked object"},
                                             {"E   D", "list of channels and objects, plots"},
                                             {"Ctrl + C   Ctrl + V", "copy, paste the camera"},
                                             {"P   V", "save a screenshot, record a video"},
                                             {"Tab   F1", "panels, this help"},
                                             {"Esc", "cancel the tool or selection, stop following"},
                                             {"Q", "quit"}};
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({size.x / 2.0f, size.y / 2.0f}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("help", nullptr, kPanelFlags | ImGuiWindowFlags_NoInputs);
  ImGui::TextUnformatted("Mouse and keys");
  ImGui::Dummy({0.0f, 4.0f * scale});
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const auto& line : kHelp) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(line[0]);
      ImGui::TableNextColumn();
      ImGui::TextColored(kDimTextColour, "%s", line[1]);
    }
    ImGui::EndTable();
  }
  ImGui::End();
}

void draw_object_labels(const FrameInput& input, const Camera& camera, float width, float height) {
  constexpr std::size_t kMaxLabels = 1000;
  constexpr ImU32 kInk = IM_COL32(25, 30, 38, 255), kHalo = IM_COL32(255, 255, 255, 190);
  static const ImVec2 kHaloOffsets[] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
  const scene::Snapshot& snapshot = input.snapshot;
  for (std::size_t i = 0; i < std::min(snapshot.object_count(), kMaxLabels); ++i) {
    const scene::ObjectSpec& object = input.catalogue[snapshot.id[i]];
    const auto& p = snapshot.position[i];
    const Eigen::Vector3d top(p[0], p[1], p[2] + object.half_extents().maxCoeff());
    const Eigen::Vector3d screen = camera.project(top, width, height);
    if (!(screen.z() > 0.0)) continue;
    const std::string text = object.label.empty() ? std::to_string(snapshot.id[i])
                                                  : object.label + " " + std::to_string(snapshot.id[i]);
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    const ImVec2 corner(static_cast<float>(screen.x()) - size.x / 2.0f,
                        static_cast<float>(screen.y()) - size.y);
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

void draw_axis_labels(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height) {
  const Axes axes = make_axes(surface);
  static constexpr const char* kNames[3] = {"x", "y", "z"};
  static constexpr ImU32 kColours[3] = {IM_COL32(190, 40, 35, 255), IM_COL32(35, 130, 50, 255),
                                        IM_COL32(35, 75, 195, 255)};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d tip = axes.origin + 1.12 * axes.length * Eigen::Vector3d::Unit(i);
    const Eigen::Vector3d screen = camera.project(tip, width, height);
    if (screen.z() <= 0.0) continue;
    const ImVec2 half = ImGui::CalcTextSize(kNames[i]);
    ImGui::GetBackgroundDrawList()->AddText(
        {static_cast<float>(screen.x()) - half.x / 2.0f, static_cast<float>(screen.y()) - half.y / 2.0f},
        kColours[i], kNames[i]);
  }
}

}  // namespace smartsurf::view
