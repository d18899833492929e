#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "smartsurf/view/panels/Panels.h"

namespace smartsurf::view {
namespace {

bool is_selected(const Entity& entity, const Controls& controls) {
  if (entity.kind == Entity::Kind::kChannel) return controls.overlay().channel == entity.channel;
  return controls.tools().selected() == entity.item;
}

void select(const Entity& entity, bool selected, Controls& controls) {
  if (entity.kind == Entity::Kind::kChannel)
    controls.overlay().channel = selected ? "" : entity.channel;
  else
    controls.tools().select(selected ? std::nullopt : std::optional(entity.item));
}

// The signals that the plots show when the entity is dragged onto them. A channel needs a cell.
std::vector<Signal> dragged_signals(const Entity& entity, const FrameInput& input, const HudState& state,
                                    const Controls& controls) {
  if (entity.kind != Entity::Kind::kChannel)
    return signals_to_add(entity.item, input.channels, state.plotted);
  const auto& item = controls.tools().selected();
  if (!item || item->kind != SceneItem::Kind::kCell) return {};
  return {{Signal::Kind::kCell, entity.channel, 0, item->row, item->column}};
}

}  // namespace

void draw_entities_section(const FrameInput& input, const scene::SurfaceSpec& surface, HudState& state,
                           Controls& controls) {
  const bool appears = controls.entities_shown() && !state.entities_were_shown;
  state.entities_were_shown = controls.entities_shown();
  if (!controls.entities_shown()) return;
  ImGui::Separator();
  char query[64];
  std::snprintf(query, sizeof query, "%s", state.entity_query.c_str());
  ImGui::SetNextItemWidth(-1.0f);
  if (appears) ImGui::SetKeyboardFocusHere();
  if (ImGui::InputTextWithHint("##query", "search: a name, an id, or row,column", query, sizeof query))
    state.entity_query = query;
  const std::vector<Entity>& entities = state.entities.find(state.entity_query, surface, input);
  const float line = ImGui::GetTextLineHeightWithSpacing();
  ImGui::BeginChild("entities", {0.0f, std::max(ImGui::GetContentRegionAvail().y, 6.0f * line)});
  ImGuiListClipper clipper;
  clipper.Begin(static_cast<int>(entities.size()));
  while (clipper.Step())
    for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
      const Entity& entity = entities[i];
      const bool selected = is_selected(entity, controls);
      ImGui::PushID(i);
      if (entity.kind == Entity::Kind::kObject) {
        const scene::Colour& c = input.catalogue[entity.item.object].colour;
        const ImVec2 at = ImGui::GetCursorScreenPos();
        const float radius = 0.32f * ImGui::GetFontSize();
        ImGui::GetWindowDrawList()->AddCircleFilled({at.x + radius, at.y + 0.5f * ImGui::GetTextLineHeight()},
                                                    radius,
                                                    ImGui::ColorConvertFloat4ToU32({c.r, c.g, c.b, 1.0f}));
        ImGui::Dummy({2.0f * radius, 1.0f});
        ImGui::SameLine();
      }
      if (ImGui::Selectable(entity.name.c_str(), selected)) select(entity, selected, controls);
      make_draggable(dragged_signals(entity, input, state, controls));
      ImGui::PopID();
    }
  clipper.End();
  if (entities.empty()) ImGui::TextDisabled("nothing matches");
  ImGui::EndChild();
}

}  // namespace smartsurf::view
