#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

constexpr const char* kShapes[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};
constexpr float kNameWidth = 9.0f;  // of the names' column, in heights of the font
const ImVec4 kFaint(0.36f, 0.40f, 0.46f, 1.0f);

void vector_row(const char* name, const char* unit, const std::array<float, 3>& v) {
  ImGui::TextColored(kFaint, "%s", name);
  ImGui::SameLine(kNameWidth * ImGui::GetFontSize());
  ImGui::Text("%.2f  %.2f  %.2f %s", v[0], v[1], v[2], unit);
}

void object_rows(const FrameInput& moment, scene::ObjectId id, Controls& controls) {
  const scene::ObjectSpec& object = moment.catalogue[id];
  ImGui::Text("Object %u%s%s", id, object.label.empty() ? "" : ": ", object.label.c_str());
  ImGui::TextColored(kFaint, "%s%s", kShapes[static_cast<int>(object.shape)], object.fixed ? ", fixed" : "");
  const auto i = index_of(moment.snapshot, id);
  if (!i) {
    ImGui::TextUnformatted("does not exist now");
    return;
  }
  vector_row("position", "u", moment.snapshot.position[*i]);
  vector_row("velocity", "u/s", moment.snapshot.velocity[*i]);
  vector_row("spin", "rad/s", moment.snapshot.angular_velocity[*i]);
  bool following = controls.followed() == id;
  if (ImGui::Checkbox("follow (O)", &following))
    controls.follow(following ? std::optional(id) : std::nullopt);
}

void plot(const PlotHistory::Series& trace, float width) {
  if (trace.values.empty()) return;
  float low = INFINITY, high = -INFINITY;
  for (const float value : trace.values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  char now[64];
  if (std::isfinite(trace.latest()))
    std::snprintf(now, sizeof now, "%.3g %s", static_cast<double>(trace.latest()), trace.unit.c_str());
  else
    std::snprintf(now, sizeof now, "no value");
  ImGui::TextColored(kFaint, "%s", trace.name.c_str());
  ImGui::SameLine(kNameWidth * ImGui::GetFontSize());
  ImGui::TextUnformatted(now);
  if (!(low <= high) || trace.values.size() < 2) return;  // a run that is paused: the number is all there is
  const float margin = std::max(0.05f * (high - low), 0.01f);
  ImGui::PushID(trace.name.c_str());
  ImGui::PlotLines("##trace", trace.values.data(), static_cast<int>(trace.values.size()), 0, nullptr,
                   low - margin, high + margin, {width, 2.6f * ImGui::GetFontSize()});
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%.3g to %.3g %s", low, high, trace.unit.c_str());
  ImGui::PopID();
}

}  // namespace

void draw_inspect_panel(const FrameInput& moment, const PlotHistory& watch, Controls& controls, float scale) {
  const auto& thing = controls.tools().selected();
  if (!thing) return;
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x - 12.0f * scale, 12.0f * scale}, ImGuiCond_Always,
                          {1.0f, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.88f);
  ImGui::Begin("inspect", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
                   ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoMove);
  if (thing->kind == Thing::Kind::kObject)
    object_rows(moment, thing->object, controls);
  else
    ImGui::Text("Cell: row %d, column %d", thing->row, thing->column);
  ImGui::Dummy({0.0f, 2.0f * scale});
  for (const PlotHistory::Series& trace : watch.traces()) plot(trace, 280.0f * scale);
  ImGui::TextColored(kFaint, "the last %.1f s      Esc: close", watch.span_s());
  ImGui::End();
}

}  // namespace smartsurf::view
