#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

constexpr const char* kShapeNames[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};
constexpr float kNameWidth = 9.0f;  // width of the name column, in font heights
const ImVec4 kDimTextColour(0.36f, 0.40f, 0.46f, 1.0f);

void draw_vector_row(const char* name, const char* unit, const std::array<float, 3>& v) {
  ImGui::TextColored(kDimTextColour, "%s", name);
  ImGui::SameLine(kNameWidth * ImGui::GetFontSize());
  ImGui::Text("%.2f  %.2f  %.2f %s", v[0], v[1], v[2], unit);
}

void draw_object_rows(const FrameInput& input, scene::ObjectId id, Controls& controls) {
  const scene::ObjectSpec& object = input.catalogue[id];
  ImGui::Text("Object %u%s%s", id, object.label.empty() ? "" : ": ", object.label.c_str());
  ImGui::TextColored(kDimTextColour, "%s%s", kShapeNames[static_cast<int>(object.shape)],
                     object.fixed ? ", fixed" : "");
  const auto i = find_object_index(input.snapshot, id);
  if (!i) {
    ImGui::TextUnformatted("not in the scene at this time");
    return;
  }
  draw_vector_row("position", "u", input.snapshot.position[*i]);
  draw_vector_row("velocity", "u/s", input.snapshot.velocity[*i]);
  if (!std::isnan(input.snapshot.angular_velocity[*i][0]))
    draw_vector_row("spin", "rad/s", input.snapshot.angular_velocity[*i]);
  bool following = controls.followed() == id;
  if (ImGui::Checkbox("follow (O)", &following))
    controls.follow(following ? std::optional(id) : std::nullopt);
}

void draw_series_plot(const PlotHistory::Series& series, float width) {
  if (series.values.empty()) return;
  float low = INFINITY, high = -INFINITY;
  for (const float value : series.values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  char latest[64];
  if (std::isfinite(series.latest()))
    std::snprintf(latest, sizeof latest, "%.3g %s", static_cast<double>(series.latest()),
                  series.unit.c_str());
  else
    std::snprintf(latest, sizeof latest, "no value");
  ImGui::TextColored(kDimTextColour, "%s", series.name.c_str());
  ImGui::SameLine(kNameWidth * ImGui::GetFontSize());
  ImGui::TextUnformatted(latest);
  if (!(low <= high) || series.values.size() < 2) return;  // nothing to plot; the number is enough
  const float margin = std::max(0.05f * (high - low), 0.01f);
  ImGui::PushID(series.name.c_str());
  ImGui::PlotLines("##trace", series.values.data(), static_cast<int>(series.values.size()), 0, nullptr,
                   low - margin, high + margin, {width, 2.6f * ImGui::GetFontSize()});
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%.3g to %.3g %s", low, high, series.unit.c_str());
  ImGui::PopID();
}

}  // namespace

void draw_inspector_panel(const FrameInput& input, const PlotHistory& history, Controls& controls,
                          float scale) {
  const auto& item = controls.tools().selected();
  if (!item) return;
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x - 12.0f * scale, 12.0f * scale}, ImGuiCond_Always,
                          {1.0f, 0.0f});
  ImGui::SetNextWindowBgAlpha(0.88f);
  ImGui::Begin("inspect", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing |
                   ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoMove);
  if (item->kind == SceneItem::Kind::kObject)
    draw_object_rows(input, item->object, controls);
  else
    ImGui::Text("Cell: row %d, column %d", item->row, item->column);
  ImGui::Dummy({0.0f, 2.0f * scale});
  for (const PlotHistory::Series& series : history.series()) draw_series_plot(series, 280.0f * scale);
  ImGui::TextColored(kDimTextColour, "last %.1f s      Esc: close", history.span_s());
  ImGui::End();
}

}  // namespace smartsurf::view
