#include "smartsurf/record/plot/TimeSeries.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "common/text/Number.h"
#include "common/text/Suggestion.h"
#include "common/text/Unit.h"
#include "common/text/Words.h"
#include "smartsurf/scene/ChannelKind.h"

namespace smartsurf::record {
namespace {

using Arguments = std::vector<std::string>;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void throw_plot_error(const std::string& what, const std::string& reason) {
  throw scene::InputError("--what " + what + ": " + reason);
}

std::optional<std::size_t> parse_index(const std::string& text) {
  std::size_t value = 0;
  return common::parse_number(text, value) ? std::optional(value) : std::nullopt;
}

void require_no_arguments(const std::string& kind, const Arguments& arguments) {
  if (!arguments.empty()) throw_plot_error(kind + ":" + arguments[0], "takes nothing after '" + kind + "'");
}

struct Cell {
  int row, column;
};

// "ROW,COLUMN", counted from 0, row 0 north.
Cell parse_cell(const Recording& recording, const std::string& kind, const std::string& text) {
  const scene::SurfaceSpec& s = recording.spec().surface;
  const auto comma = text.find(',');
  const auto row = parse_index(text.substr(0, comma));
  const auto column = comma == text.npos ? std::nullopt : parse_index(text.substr(comma + 1));
  if (!row || !column) throw_plot_error(kind + ":" + text, "must be " + kind + ":ROW,COLUMN");
  if (*row >= static_cast<std::size_t>(s.rows) || *column >= static_cast<std::size_t>(s.columns))
    throw_plot_error(kind + ":" + text, "the surface has rows 0 to " + std::to_string(s.rows - 1) +
                                            " and columns 0 to " + std::to_string(s.columns - 1));
  return {static_cast<int>(*row), static_cast<int>(*column)};
}

std::size_t parse_object_id(const Recording& recording, const std::string& kind, const std::string& text) {
  const auto id = parse_index(text);
  const std::size_t objects = recording.spec().objects.size();
  if (!id) throw_plot_error(kind + ":" + text, "must be " + kind + ":ID, the number of an object");
  if (*id >= objects)
    throw_plot_error(kind + ":" + text, objects == 0 ? std::string("there are no objects")
                                                     : "the objects are 0 to " + std::to_string(objects - 1));
  return *id;
}

std::string curve_name(const Recording& recording, std::size_t id) {
  const std::string& label = recording.spec().objects[id].label;
  return "object " + std::to_string(id) + (label.empty() ? "" : ", " + label);
}

void require_cells(const std::string& kind, const Arguments& cells) {
  if (cells.empty()) throw_plot_error(kind, "needs a cell: " + kind + ":ROW,COLUMN");
}

std::string curve_name(const Cell& cell) {
  return "row " + std::to_string(cell.row) + ", column " + std::to_string(cell.column);
}

TimeSeries height_series(const Recording& recording, const std::string& kind, const Arguments& cells) {
  require_cells(kind, cells);
  if (!recording.has_heights()) throw_plot_error(kind, recording.path().string() + " holds no heights");
  TimeSeries result{"Height of the actuators", "height [u]", {}};
  std::vector<std::size_t> cell_indices;
  for (const std::string& text : cells) {
    const Cell cell = parse_cell(recording, kind, text);
    cell_indices.push_back(recording.spec().surface.index(cell.row, cell.column));
    result.curves.push_back({curve_name(cell), {}});
  }
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    const std::span<const float> all = recording.read_heights(frame);
    for (std::size_t i = 0; i < cell_indices.size(); ++i)
      result.curves[i].values.push_back(all[cell_indices[i]]);
  }
  return result;
}

// How many of the parts from `first` on, joined by colons, are the longest known name; 0 if there is none.
template <class IsKnown>
std::size_t longest_name(const Arguments& parts, std::size_t first, IsKnown is_known) {
  std::size_t longest = 0;
  std::string name;
  for (std::size_t i = first; i < parts.size(); ++i) {
    name += (i > first ? ":" : "") + parts[i];
    if (is_known(name)) longest = i - first + 1;
  }
  return longest;
}

std::string joined(const Arguments& parts, std::size_t first, std::size_t count) {
  std::string name;
  for (std::size_t i = first; i < first + count; ++i) name += (i > first ? ":" : "") + parts[i];
  return name;
}

struct Channel {
  ChannelGroup group;
  std::string name;
  std::optional<std::size_t> component;  // nullopt: all
};

// By its name in the file, by that with its component, NAME[0], or by one that --cells takes.
std::optional<Channel> find_channel(const Recording& recording, const std::string& text) {
  constexpr std::pair<ChannelGroup, std::string_view> kGroups[] = {
      {ChannelGroup::kSensors, ""},
      {ChannelGroup::kActuators, ""},
      {ChannelGroup::kRegisters, ""},
      {ChannelGroup::kActuators, prefix_of(scene::ChannelKind::kCommand)},
      {ChannelGroup::kRegisters, prefix_of(scene::ChannelKind::kRegister)}};
  const std::size_t bracket = text.ends_with(']') ? text.rfind('[') : text.npos;
  const auto component =
      bracket == text.npos ? std::nullopt : parse_index(text.substr(bracket + 1, text.size() - bracket - 2));
  for (const auto& [group, prefix] : kGroups)
    for (const std::string& name : recording.channel_names(group)) {
      const std::string full_name = std::string(prefix) + name;
      if (text == full_name) return Channel{group, name, std::nullopt};
      if (component && text.substr(0, bracket) == full_name) return Channel{group, name, component};
    }
  return std::nullopt;
}

TimeSeries channel_series(const Recording& recording, const std::string& shown, const Channel& channel,
                          const Arguments& cells) {
  const std::size_t components = recording.channel_components(channel.group, channel.name);
  if (channel.component && (components == 1 || *channel.component >= components))
    throw_plot_error(
        shown, "must be " + channel.name +
                   (components == 1 ? ", which has one component"
                                    : "[0] to " + channel.name + "[" + std::to_string(components - 1) + "]"));
  require_cells(shown, cells);
  const std::string unit = recording.channel_info(channel.group, channel.name).unit;
  TimeSeries result{"Channel " + shown, common::with_unit(shown, unit), {}};
  for (const std::string& text : cells) {
    const Cell cell = parse_cell(recording, shown, text);
    const std::vector<float> values =
        recording.read_cell_history(channel.group, channel.name, cell.row, cell.column);
    const std::size_t first = channel.component.value_or(0),
                      last = channel.component.value_or(components - 1);
    for (std::size_t i = first; i <= last; ++i) {
      Curve& curve = result.curves.emplace_back();
      curve.name = curve_name(cell) + (first < last ? ", [" + std::to_string(i) + "]" : "");
      for (std::size_t k = i; k < values.size(); k += components) curve.values.push_back(values[k]);
    }
  }
  return result;
}

// Says of a channel and its cells, NAME:ROW,COLUMN, how to record it; "" if the run recorded all of its kind.
std::string how_to_record(const Recording& recording, const Arguments& parts) {
  const auto cell =
      std::ranges::find_if(parts, [](const std::string& part) { return part.find(',') != part.npos; });
  if (cell == parts.end() || !recording.meta().is_simulated) return "";
  std::string name = joined(parts, 0, static_cast<std::size_t>(cell - parts.begin()));
  if (const std::size_t bracket = name.rfind('['); name.ends_with(']') && bracket != name.npos)
    name.resize(bracket);
  const scene::ChannelReference wanted = scene::parse_channel(name);
  const bool is_command =
      std::ranges::any_of(recording.spec().surface.actuator_channels(),
                          [&](const scene::ActuatorChannel& channel) { return channel.name == wanted.name; });
  if (!is_command && wanted.kind != scene::ChannelKind::kSensor) return "";
  if (!recording.channel_names(is_command ? ChannelGroup::kActuators : ChannelGroup::kSensors).empty())
    return "";
  return recording.path().string() +
         (is_command
              ? " holds no commands, which record { actuators = true } keeps"
              : " holds no sensors: record { sensors = true } keeps those that the experiment declares");
}

// The channel that a fixed kind of the same name hides.
TimeSeries named_channel_series(const Recording& recording, const std::string& kind,
                                const Arguments& arguments) {
  if (arguments.empty()) throw_plot_error(kind, "needs a channel and cells: channel:NAME:ROW,COLUMN");
  const std::size_t count = longest_name(
      arguments, 0, [&](const std::string& name) { return find_channel(recording, name).has_value(); });
  if (count == 0) {
    if (const std::string how = how_to_record(recording, arguments); !how.empty())
      throw_plot_error(kind + ":" + arguments[0], how);
    std::vector<std::string> known;
    for (const ChannelGroup group : kChannelGroups)
      std::ranges::copy(recording.channel_names(group), std::back_inserter(known));
    throw_plot_error(kind + ":" + arguments[0], known.empty()
                                                    ? recording.path().string() + " holds no channels"
                                                    : "no such channel; known: " + common::join(known) +
                                                          common::did_you_mean(arguments[0], known));
  }
  const std::string name = joined(arguments, 0, count);
  return channel_series(recording, name, *find_channel(recording, name),
                        {arguments.begin() + static_cast<std::ptrdiff_t>(count), arguments.end()});
}

// One curve per object in `ids`; if there are none, the mean over the existing objects that are not fixed.
// metric: maps an object's three floats to a number; NaN if the object does not exist.
template <class Metric>
TimeSeries object_series(const Recording& recording, const std::string& kind, const Arguments& ids,
                         TimeSeries result, Metric metric,
                         std::vector<float> (Recording::*read)(std::size_t, std::size_t) const) {
  const std::size_t objects = recording.spec().objects.size(), frames = recording.frames();
  std::vector<std::size_t> selected;
  for (const std::string& text : ids) {
    selected.push_back(parse_object_id(recording, kind, text));
    result.curves.push_back({curve_name(recording, selected.back()), {}});
  }
  if (ids.empty()) result.curves.push_back({"mean", {}});
  const std::size_t block = std::max<std::size_t>(1, (1u << 20) / std::max<std::size_t>(3 * objects, 1));
  for (std::size_t first = 0; first < frames; first += block) {
    const std::size_t count = std::min(block, frames - first);
    const std::vector<float> numbers = (recording.*read)(first, count);
    for (std::size_t f = 0; f < count; ++f) {
      const float* const frame = numbers.data() + f * objects * 3;
      for (std::size_t i = 0; i < selected.size(); ++i)
        result.curves[i].values.push_back(metric(frame + 3 * selected[i]));
      if (!selected.empty()) continue;
      double sum = 0.0, present = 0.0;
      for (std::size_t id = 0; id < objects; ++id) {
        const double value = metric(frame + 3 * id);
        if (recording.spec().objects[id].fixed || std::isnan(value)) continue;
        sum += value;
        ++present;
      }
      result.curves[0].values.push_back(present > 0.0 ? sum / present : kMissing);
    }
  }
  return result;
}

double length_of(const float* v) {
  return std::sqrt(double{v[0]} * v[0] + double{v[1]} * v[1] + double{v[2]} * v[2]);
}

TimeSeries speed_series(const Recording& recording, const std::string& kind, const Arguments& ids) {
  return object_series(recording, kind, ids,
                       {"Speed of the objects", ids.empty() ? "mean speed [u/s]" : "speed [u/s]", {}},
                       length_of, &Recording::read_velocities);
}

TimeSeries spin_series(const Recording& recording, const std::string& kind, const Arguments& ids) {
  if (recording.has_objects() && !recording.has_angular_velocities())
    throw scene::InputError(recording.path().string() +
                            ": has no angular velocities: an older version recorded it");
  return object_series(
      recording, kind, ids,
      {"Angular speed of the objects", ids.empty() ? "mean spin [rad/s]" : "spin [rad/s]", {}}, length_of,
      &Recording::read_angular_velocities);
}

TimeSeries coordinate_series(const Recording& recording, const std::string& kind, const Arguments& ids) {
  const int axis = kind[0] - 'x';
  return object_series(
      recording, kind, ids, {"Position of the objects", (ids.empty() ? "mean " : "") + kind + " [u]", {}},
      [axis](const float* p) { return double{p[axis]}; }, &Recording::read_positions);
}

TimeSeries object_count_series(const Recording& recording, const std::string& kind,
                               const Arguments& arguments) {
  require_no_arguments(kind, arguments);
  const std::size_t object_count = recording.spec().objects.size();
  TimeSeries result{
      .title = "Number of objects", .axis_title = "objects", .curves = {{"objects", {}}}, .counts = true};
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    const std::vector<float> p = recording.read_positions(frame, 1);
    double present = 0.0;
    for (std::size_t id = 0; id < object_count; ++id) present += std::isnan(p[3 * id]) ? 0.0 : 1.0;
    result.curves[0].values.push_back(present);
  }
  return result;
}

TimeSeries contact_count_series(const Recording& recording, const std::string& kind,
                                const Arguments& arguments) {
  require_no_arguments(kind, arguments);
  if (!recording.meta().is_simulated)
    throw_plot_error(kind, recording.path().string() +
                               " is the recording of a live surface, of which no contacts are known");
  return {.title = "Contact points in each tick's last physics step",
          .axis_title = "contacts",
          .curves = {{"contacts", {recording.contact_counts().begin(), recording.contact_counts().end()}}},
          .counts = true};
}

// Also those that only on_finish has set, of which no curve can be drawn.
std::vector<std::string> known_metrics(const Recording& recording) {
  std::vector<std::string> names = recording.metric_names();
  if (!recording.result()) return names;
  for (const auto& [name, value] : recording.result()->metrics)
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  return names;
}

TimeSeries metric_series(const Recording& recording, const std::string& kind, const Arguments& names) {
  const std::vector<std::string> known = known_metrics(recording), drawable = recording.metric_names();
  if (names.empty()) throw_plot_error(kind, "needs a name: metric:NAME");
  TimeSeries result{"Metrics of the script", "value", {}};
  for (std::size_t first = 0, count = 0; first < names.size(); first += count) {
    count = longest_name(
        names, first, [&](const std::string& name) { return std::ranges::find(known, name) != known.end(); });
    const std::string name = joined(names, first, std::max<std::size_t>(count, 1));
    if (count == 0)
      throw_plot_error(kind + ":" + name, known.empty() ? recording.path().string() + " holds no metrics"
                                                        : "no such metric; known: " + common::join(known) +
                                                              common::did_you_mean(name, known));
    if (std::ranges::find(drawable, name) == drawable.end())
      throw_plot_error(kind + ":" + name,
                       "has a value at the end of the run only, which smartsurf info prints");
    result.curves.push_back({name, recording.read_metric(name)});
  }
  if (result.curves.size() == 1) result.axis_title = result.curves[0].name;
  result.success_s = recording.success_s();
  return result;
}

// A register by the name that --cells takes.
TimeSeries register_series(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  const std::vector<std::string> known = recording.channel_names(ChannelGroup::kRegisters);
  if (arguments.empty()) throw_plot_error(kind, "needs a register and cells: apron:NAME:ROW,COLUMN");
  const std::string& name = arguments.front();
  if (std::ranges::find(known, name) == known.end())
    throw_plot_error(kind + ":" + name, known.empty() ? recording.path().string() +
                                                            " holds no registers, which run "
                                                            "--record-registers " +
                                                            name + " keeps"
                                                      : "no such register; known: " + common::join(known) +
                                                            common::did_you_mean(name, known));
  return channel_series(recording, name, {ChannelGroup::kRegisters, name, std::nullopt},
                        {arguments.begin() + 1, arguments.end()});
}

struct SeriesDefinition {
  const char* name;
  const char* usage;
  TimeSeries (*make)(const Recording&, const std::string& kind, const Arguments&);
};
// To add a series, write its function and add a line here.
constexpr SeriesDefinition kSeriesDefinitions[] = {
    {"speed", "speed[:ID…]", speed_series},
    {"spin", "spin[:ID…]", spin_series},
    {"x", "x[:ID…]", coordinate_series},
    {"y", "y[:ID…]", coordinate_series},
    {"z", "z[:ID…]", coordinate_series},
    {"objects", "objects", object_count_series},
    {"contacts", "contacts", contact_count_series},
    {"metric", "metric:NAME…", metric_series},
    {"height", "height:ROW,COLUMN…", height_series},
    {"apron", "apron:NAME:ROW,COLUMN…", register_series},
    {"channel", "channel:NAME:ROW,COLUMN…", named_channel_series}};

}  // namespace

std::vector<std::string> time_series_kinds() {
  std::vector<std::string> usages;
  for (const SeriesDefinition& definition : kSeriesDefinitions) usages.emplace_back(definition.usage);
  return usages;
}

TimeSeries time_series(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  std::vector<std::string> known = {"trajectories", "time-spent"};
  for (const SeriesDefinition& definition : kSeriesDefinitions) {
    known.emplace_back(definition.name);
    if (kind != definition.name) continue;
    try {
      return definition.make(recording, kind, arguments);
    } catch (const scene::InputError& error) {
      if (!find_channel(recording, kind)) throw;
      throw scene::InputError(std::string(error.what()) + "; the recorded channel is channel:" + kind +
                              ":ROW,COLUMN");
    }
  }
  Arguments parts = {kind};
  parts.insert(parts.end(), arguments.begin(), arguments.end());
  const auto rest = [&](std::size_t count) {
    return Arguments(parts.begin() + static_cast<std::ptrdiff_t>(count), parts.end());
  };
  if (const std::size_t count = longest_name(
          parts, 0, [&](const std::string& name) { return find_channel(recording, name).has_value(); })) {
    const std::string name = joined(parts, 0, count);
    return channel_series(recording, name, *find_channel(recording, name), rest(count));
  }
  const std::vector<std::string> metrics = known_metrics(recording);
  if (const std::size_t count = longest_name(parts, 0, [&](const std::string& name) {
        return std::ranges::find(metrics, name) != metrics.end();
      })) {
    require_no_arguments(joined(parts, 0, count), rest(count));
    return metric_series(recording, "metric", {joined(parts, 0, count)});
  }
  for (const ChannelGroup group : kChannelGroups)
    for (const std::string& name : recording.channel_names(group))
      if (std::ranges::find(known, name) == known.end()) known.push_back(name);
  known.insert(known.end(), metrics.begin(), metrics.end());
  const std::string meant = common::did_you_mean(kind, known);
  if (const std::string how = how_to_record(recording, parts); !how.empty())
    throw_plot_error(kind, how + meant);
  throw_plot_error(kind, "unknown kind of plot; known: " + common::join(known) + meant);
}

}  // namespace smartsurf::record
