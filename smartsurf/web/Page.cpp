#include "smartsurf/web/Page.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <span>

#include "common/files/AtomicFile.h"
#include "smartsurf/scene/SurfaceBounds.h"
#include "smartsurf/web/Assets.h"
#include "smartsurf/web/Base64.h"
#include "smartsurf/web/Frames.h"
#include "smartsurf/web/SceneJson.h"
#include "smartsurf/web/SeriesEncoder.h"

namespace smartsurf::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using record::Recording;

constexpr std::size_t kMaxUnpackedBytes = std::size_t{400} << 20;  // in the browser's memory

// A channel of cells, its group in the recording (none: the heights) and its unit ("": none), with a series
// for each component.
struct CellChannel {
  std::string name;
  std::optional<record::ChannelGroup> group;
  std::string unit;
  std::vector<SeriesLayout> components;
};

// The minimum and maximum value of each component in the selected frames.
void find_ranges(const Recording& recording, const std::vector<std::size_t>& frames, CellChannel& channel) {
  std::vector<SeriesLayout>& components = channel.components;
  for (SeriesLayout& component : components) {
    component.low = std::numeric_limits<double>::infinity();
    component.high = -component.low;
  }
  for (const std::size_t frame : frames) {
    const std::vector<float> values = recording.read_channel(*channel.group, channel.name, frame);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) continue;
      SeriesLayout& component = components[i % components.size()];
      component.low = std::min(component.low, double{values[i]});
      component.high = std::max(component.high, double{values[i]});
    }
  }
  for (SeriesLayout& component : components) {
    if (!(component.low <= component.high)) component.low = 0.0, component.high = 1.0;
    if (component.low == component.high) component.high = component.low + 1.0;
  }
}

std::vector<CellChannel> collect_cell_channels(const Recording& recording,
                                               const std::vector<std::size_t>& frames) {
  const scene::SurfaceSpec& surface = recording.spec().surface;
  const std::size_t cell_count = surface.cell_count();
  std::vector<CellChannel> channels;
  if (recording.has_heights()) {
    channels.push_back(
        {"height", std::nullopt, "u", {{surface.pin.min_height, surface.max_top_height(), 1, cell_count}}});
  }
  for (const record::ChannelGroup group : record::kChannelGroups)
    for (const std::string& name : recording.channel_names(group)) {
      const std::size_t components = recording.channel_components(group, name);
      if (components == 0 ||
          recording.read_channel(group, name, frames.front()).size() != components * cell_count)
        continue;
      CellChannel& channel = channels.emplace_back();
      channel = {name, group, recording.channel_info(group, name).unit, {}};
      channel.components.assign(components, {0.0, 1.0, 1, cell_count});
      find_ranges(recording, frames, channel);
    }
  return channels;
}

// Objects far away, such as those that fall beside the table, cost bytes, but coarsen no position.
SeriesLayout position_layout(const Recording& recording, const std::vector<std::size_t>& frames) {
  SeriesLayout layout{0.0, 1.0, 2, 3 * recording.spec().objects.size()};
  layout.low = std::numeric_limits<double>::infinity();
  layout.high = -layout.low;
  for (const std::size_t frame : frames)
    for (const float value : recording.read_positions(frame, 1)) {
      if (!std::isfinite(value)) continue;
      layout.low = std::min(layout.low, double{value});
      layout.high = std::max(layout.high, double{value});
    }
  if (!(layout.low <= layout.high)) layout.low = layout.high = 0.0;
  const scene::SurfaceBounds table = scene::compute_surface_bounds(recording.spec().surface);
  const double longest = 4.0 * std::max(table.width(), table.height());  // that two bytes resolve
  if (layout.high - layout.low > longest) {
    layout.bytes_per_value = 4;
    layout.high = std::max(layout.high, layout.low + longest / 0xFFFE * 0xFFFFFFFE);
  }
  return layout;
}

json series_json(const std::string& name, const SeriesLayout& layout, const std::string& unit = "") {
  return {{"name", name},
          {"unit", unit},
          {"low", layout.low},
          {"high", layout.high},
          {"bytes", layout.bytes_per_value},
          {"values", layout.values_per_frame}};
}

// Quantities of the whole run, one value per frame; null where undefined.
json plots_json(const Recording& recording, const std::vector<std::size_t>& frames) {
  json plots = json::array();
  const auto add = [&](const std::string& name, auto value_of) {
    json values = json::array();
    for (const std::size_t frame : frames) {
      const double value = value_of(frame);
      values.push_back(std::isfinite(value) ? json(value) : json());
    }
    plots.push_back({{"name", name}, {"values", std::move(values)}});
  };
  if (!recording.has_objects() || recording.spec().objects.empty()) return plots;
  for (const std::string& name : recording.metric_names()) {
    const std::vector<double> values = recording.read_metric(name);
    add(name, [&](std::size_t frame) { return values[frame]; });
  }
  add("contact points",
      [&](std::size_t frame) { return static_cast<double>(recording.contact_counts()[frame]); });
  return plots;
}

json page_json(const Recording& recording, const std::vector<std::size_t>& frames) {
  json time = json::array();
  for (const std::size_t frame : frames) time.push_back(recording.times()[frame]);
  json page = scene_json(recording.spec(), recording.spec().objects);
  if (!recording.meta().is_simulated) page.erase("seed");
  page["time"] = std::move(time);
  page["plots"] = plots_json(recording, frames);
  return page;
}

void append_series(std::vector<std::uint8_t>& stream, const SeriesEncoder& encoder) {
  stream.insert(stream.end(), encoder.bytes().begin(), encoder.bytes().end());
}

void encode_objects(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                    std::vector<std::uint8_t>& stream) {
  const std::size_t objects = recording.spec().objects.size();
  if (!recording.has_objects() || objects == 0) return;
  SeriesEncoder positions(position_layout(recording, frames)), orientations({-1.0, 1.0, 2, 4 * objects});
  std::vector<float> orientation(4 * objects);
  for (const std::size_t frame : frames) {
    positions.add(recording.read_positions(frame, 1));
    const scene::Snapshot snapshot = recording.read_snapshot(frame);
    std::fill(orientation.begin(), orientation.end(), std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0; i < snapshot.object_count(); ++i)
      std::copy(snapshot.orientation[i].begin(), snapshot.orientation[i].end(),
                orientation.begin() + 4 * snapshot.id[i]);
    orientations.add(orientation);
  }
  series.push_back(series_json("position", positions.layout()));
  series.push_back(series_json("orientation", orientations.layout()));
  append_series(stream, positions);
  append_series(stream, orientations);
}

void encode_cell_channels(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                          std::vector<std::uint8_t>& stream) {
  for (const CellChannel& channel : collect_cell_channels(recording, frames)) {
    const std::size_t components = channel.components.size();
    std::vector<SeriesEncoder> encoders(channel.components.begin(), channel.components.end());
    std::vector<float> channel_values, plane;
    for (const std::size_t frame : frames) {
      if (channel.group) channel_values = recording.read_channel(*channel.group, channel.name, frame);
      const std::span<const float> values =
          channel.group ? std::span<const float>(channel_values) : recording.read_heights(frame);
      plane.resize(values.size() / components);
      for (std::size_t k = 0; k < components; ++k) {
        for (std::size_t cell = 0; cell < plane.size(); ++cell) plane[cell] = values[cell * components + k];
        encoders[k].add(plane);
      }
    }
    for (std::size_t k = 0; k < components; ++k) {
      const std::string index = components == 1 ? "" : "[" + std::to_string(k) + "]";
      series.push_back(
          series_json(channel.group ? to_string(*channel.group) + "/" + channel.name + index : "height",
                      encoders[k].layout(), channel.unit));
      append_series(stream, encoders[k]);
    }
  }
}

// The states of the mechanisms. Angles are wrapped, because the page does not need the number of turns.
void encode_actuator_states(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                            std::vector<std::uint8_t>& stream) {
  if (!recording.has_motion()) return;
  constexpr double kHalfTurn = std::numbers::pi;
  const std::size_t cells = recording.spec().surface.cell_count();
  SeriesEncoder encoder({-kHalfTurn, kHalfTurn, 2, 3 * cells});
  std::vector<float> states(3 * cells);
  const auto wrap_angle = [](float angle) {
    return std::remainder(angle, 2.0F * static_cast<float>(kHalfTurn));
  };
  for (const std::size_t frame : frames) {
    const scene::Snapshot snapshot = recording.read_snapshot(frame);
    for (std::size_t i = 0; i < snapshot.actuator_state.size(); ++i) {
      states[3 * i] = wrap_angle(snapshot.actuator_state[i].a);
      states[3 * i + 1] = wrap_angle(snapshot.actuator_state[i].b);
      states[3 * i + 2] = snapshot.actuator_state[i].level;
    }
    encoder.add(states);
  }
  series.push_back(series_json("motion", encoder.layout()));
  append_series(stream, encoder);
}

void encode_skin(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                 std::vector<std::uint8_t>& stream) {
  if (!recording.spec().surface.skin) return;
  std::vector<std::vector<float>> heights;
  SeriesLayout layout{0.0, 1e-3, 2, 0};
  for (const std::size_t frame : frames) {
    heights.push_back(recording.read_snapshot(frame).skin_height);
    layout.values_per_frame = heights.back().size();
    for (const float z : heights.back()) {
      layout.low = std::min(layout.low, double{z});
      layout.high = std::max(layout.high, double{z});
    }
  }
  SeriesEncoder encoder(layout);
  for (const std::vector<float>& frame : heights) encoder.add(frame);
  series.push_back(series_json("skin", layout));
  append_series(stream, encoder);
}

void require_size_limit(const Recording& recording, std::size_t frames) {
  std::size_t bytes_per_frame = 20 * recording.spec().objects.size();  // positions of 12 at most
  const std::size_t cells = recording.spec().surface.cell_count();
  if (const auto& skin = recording.spec().surface.skin)
    bytes_per_frame += 6 * static_cast<std::size_t>(skin->rows) * static_cast<std::size_t>(skin->columns);
  std::size_t values = 1 + (recording.has_motion() ? 6 : 0);
  for (const record::ChannelGroup group : record::kChannelGroups)
    for (const std::string& name : recording.channel_names(group))
      values += recording.channel_components(group, name);
  bytes_per_frame += cells * values;
  if (bytes_per_frame * frames <= kMaxUnpackedBytes) return;
  const double fraction =
      static_cast<double>(kMaxUnpackedBytes) / static_cast<double>(bytes_per_frame * frames);
  throw scene::InputError(recording.path().string() + ": " + std::to_string(frames) +
                          " frames are too many for a page; multiply --fps by " + std::to_string(fraction) +
                          " or less");
}

// Replaces every {{NAME}} in the text. Inserted values are not expanded again.
std::string expand_template(std::string_view text,
                            const std::vector<std::pair<std::string_view, std::string_view>>& values) {
  std::string page;
  for (std::size_t position = 0; position < text.size();) {
    const std::size_t open = text.find("{{", position);
    page += text.substr(position, open - position);
    if (open == text.npos) break;
    const std::size_t close = text.find("}}", open);
    const std::string_view name = text.substr(open + 2, close - open - 2);
    for (const auto& [known, value] : values)
      if (known == name) page += value;
    position = close + 2;
  }
  return page;
}

// Escapes text for an HTML element.
std::string escape_html(const std::string& text) {
  std::string html;
  for (const char c : text) html += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
  return html;
}

// JSON for a script element. Escapes "<", because "</script" would end the element.
std::string dump_script_safe(const json& value) {
  std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != text.npos; at += 6) text.replace(at, 1, "\\u003c");
  return text;
}

}  // namespace

void write_page(const Recording& recording, const fs::path& path, const PageOptions& options) {
  const std::vector<std::size_t> frames = select_frames(recording, options.frames_per_second);
  require_size_limit(recording, frames.size());
  json scene = page_json(recording, frames), series = json::array();
  std::vector<std::uint8_t> stream;
  encode_objects(recording, frames, series, stream);
  encode_cell_channels(recording, frames, series, stream);
  encode_actuator_states(recording, frames, series, stream);
  encode_skin(recording, frames, series, stream);
  scene["series"] = std::move(series);
  const std::string data = base64(compress(stream)), description = dump_script_safe(scene);
  const std::string page = expand_template(page_html(), {{"TITLE", escape_html(scene["title"])},
                                                         {"SCENE", description},
                                                         {"FRAMES", data},
                                                         {"LICENCE", three_licence()},
                                                         {"THREE", three_js()},
                                                         {"MECHANISMS", mechanisms_js()},
                                                         {"TABLE", table_js()},
                                                         {"PLOTS", plots_js()},
                                                         {"PLAYER", player_js()}});
  if (const std::error_code error = common::replace_file(path, page))
    throw scene::InputError(path.string() + ": cannot be written: " + error.message());
}

}  // namespace smartsurf::web
