#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/text/Unit.h"
#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

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
  ImGui::TextColored(kDimTextColour, "%s%s", shape_name(object.shape), object.fixed ? ", fixed" : "");
  const auto i = find_object_index(input.snapshot, id);
  if (!i) {
    ImGui::TextUnformatted("not in the scene at this time");
    return;
  }
  draw_vector_row("position", "u", input.snapshot.position[*i]);
  if (!object.centre_of_mass.isZero(0.0)) {
    const Eigen::Vector3f com = object.centre_of_mass.cast<float>();
    draw_vector_row("com", "u", {com.x(), com.y(), com.z()});
  }
  draw_vector_row("velocity", "u/s", input.snapshot.velocity[*i]);
  if (!std::isnan(input.snapshot.angular_velocity[*i][0]))
    draw_vector_row("spin", "rad/s", input.snapshot.angular_velocity[*i]);
  bool following = controls.followed() == id;
  if (ImGui::Checkbox("follow with the camera", &following))
    controls.follow(following ? std::optional(id) : std::nullopt);
}

// The signal's value in the frame on display; NaN if it has none.
double current_value(const FrameInput& input, const Signal& signal, const scene::SurfaceSpec& surface) {
  if (signal.kind == Signal::Kind::kObject) return object_value(signal, input.snapshot);
  const auto channel = std::ranges::find(input.channels, signal.quantity, &Channel::name);
  if (channel == input.channels.end() || channel->values.empty()) return NAN;
  return channel->values[surface.index(signal.row, signal.column)];
}

// The current value, a switch that adds the signal to the plots, and a small chart of what is stored.
std::optional<double> draw_signal(const FrameInput& input, std::size_t index, HudState& state,
                                  Controls& controls, double value, float width) {
  const PlotData::Series& series = state.inspected.series()[index];
  const std::string unit = common::typeset_unit(unit_of(series.signal, input.channels));
  ImGui::PushID(static_cast<int>(index));
  ImGui::BeginGroup();
  ImGui::AlignTextToFramePadding();
  ImGui::TextColored(kDimTextColour, "%s", series.signal.quantity.c_str());
  ImGui::SameLine(kNameWidth * ImGui::GetFontSize());
  if (std::isfinite(value))
    ImGui::Text("%.4g %s", value, unit.c_str());
  else
    ImGui::TextUnformatted("no value");
  ImGui::EndGroup();
  make_draggable({series.signal});
  const float box =
      ImGui::CalcTextSize("plot").x + ImGui::GetFrameHeight() + ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SameLine(std::max(width - box, kNameWidth * ImGui::GetFontSize() + 90.0f));
  bool plotted = state.plotted.contains(series.signal);
  if (ImGui::Checkbox("plot", &plotted)) {
    if (plotted)
      state.plotted.add(series.signal);
    else
      state.plotted.remove(series.signal);
    if (!controls.plots_shown()) controls.perform(UiAction::kPlots, {});
  }
  std::optional<double> clicked_s;
  const std::vector<double>& times = state.inspected.times();
  if (times.size() > 1 && series.values.size() == times.size())
    clicked_s = draw_chart(state.inspected,
                           {"chart", {index}, "", times.front(), times.back(), input.snapshot.time_s}, width,
                           4.6f * ImGui::GetFontSize());
  ImGui::PopID();
  return clicked_s;
}

}  // namespace

void draw_inspector_panel(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
                          const DockRect& area, HudState& state, Controls& controls, float scale) {
  const auto& item = controls.tools().selected();
  if (!item) return;
  begin_dock("inspect", area);
  const float width = ImGui::GetContentRegionAvail().x;
  if (item->kind == SceneItem::Kind::kObject)
    draw_object_rows(input, item->object, controls);
  else
    ImGui::Text("Cell: row %d, column %d", item->row, item->column);
  ImGui::Dummy({0.0f, 2.0f * scale});
  for (std::size_t i = 0; i < state.inspected.series().size(); ++i) {
    const Signal& signal = state.inspected.series()[i].signal;
    const auto clicked_s =
        draw_signal(input, i, state, controls, current_value(input, signal, surface), width);
    if (clicked_s && status.timeline) controls.seek_time(*clicked_s);
  }
  const std::vector<double>& times = state.inspected.times();
  if (times.size() > 1)
    ImGui::TextColored(kDimTextColour, "%.1f s stored      Esc: close", times.back() - times.front());
  else
    ImGui::TextColored(kDimTextColour, "Esc: close");
  ImGui::End();
}

}  // namespace smartsurf::view
