#include "smartsurf/record/plot/TimeSeries.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/text/Number.h"
#include "common/text/Suggestion.h"
#include "common/text/Words.h"

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

TimeSeries channel_series(const Recording& recording, const std::string& group, const std::string& name,
                          const Arguments& cells) {
  require_cells(name, cells);
  const std::string unit = recording.channel_info(group, name).unit;
  TimeSeries result{"Channel " + name, unit.empty() ? name : name + " [" + unit + "]", {}};
  for (const std::string& text : cells) {
    const Cell cell = parse_cell(recording, name, text);
    const std::vector<float> values = recording.read_cell_history(group, name, cell.row, cell.column);
    result.curves.push_back({curve_name(cell), {values.begin(), values.end()}});
  }
  return result;
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
  TimeSeries result{"Number of objects", "objects", {{"objects", {}}}};
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
  return {"Contact points in each tick's last physics step",
          "contacts",
          {{"contacts", {recording.contact_counts().begin(), recording.contact_counts().end()}}}};
}

TimeSeries metric_series(const Recording& recording, const std::string& kind, const Arguments& names) {
  const std::vector<std::string> known = recording.metric_names();
  if (names.empty()) throw_plot_error(kind, "needs a name: metric:NAME");
  TimeSeries result{"Metrics of the script", names.size() == 1 ? names[0] : "value", {}};
  for (const std::string& name : names) {
    if (std::ranges::find(known, name) == known.end())
      throw_plot_error(kind + ":" + name, known.empty() ? recording.path().string() + " holds no metrics"
                                                        : "no such metric; known: " + common::join(known) +
                                                              common::did_you_mean(name, known));
    result.curves.push_back({name, recording.read_metric(name)});
  }
  result.success_s = recording.success_s();
  return result;
}

// A register by the name that --cells takes.
TimeSeries register_series(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  const std::vector<std::string> known = recording.channel_names("registers");
  if (arguments.empty()) throw_plot_error(kind, "needs a register and cells: apron:NAME:ROW,COLUMN");
  const std::string& name = arguments.front();
  if (std::ranges::find(known, name) == known.end())
    throw_plot_error(kind + ":" + name, known.empty() ? recording.path().string() +
                                                            " holds no registers, which run "
                                                            "--record-registers " +
                                                            name + " keeps"
                                                      : "no such register; known: " + common::join(known) +
                                                            common::did_you_mean(name, known));
  return channel_series(recording, "registers", name, {arguments.begin() + 1, arguments.end()});
}

struct SeriesDefinition {
  const char* name;
  const char* usage;
  TimeSeries (*make)(const Recording&, const std::string& kind, const Arguments&);
};
// To add a series, write its function and add a line here.
constexpr SeriesDefinition kSeriesDefinitions[] = {{"speed", "speed[:ID…]", speed_series},
                                                   {"spin", "spin[:ID…]", spin_series},
                                                   {"x", "x[:ID…]", coordinate_series},
                                                   {"y", "y[:ID…]", coordinate_series},
                                                   {"z", "z[:ID…]", coordinate_series},
                                                   {"objects", "objects", object_count_series},
                                                   {"contacts", "contacts", contact_count_series},
                                                   {"metric", "metric:NAME…", metric_series},
                                                   {"height", "height:ROW,COLUMN…", height_series},
                                                   {"apron", "apron:NAME:ROW,COLUMN…", register_series}};

}  // namespace

std::vector<std::string> time_series_kinds() {
  std::vector<std::string> usages;
  for (const SeriesDefinition& definition : kSeriesDefinitions) usages.emplace_back(definition.usage);
  return usages;
}

TimeSeries time_series(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  std::vector<std::string> known = {"trajectories", "time-spent"};
  for (const SeriesDefinition& definition : kSeriesDefinitions) {
    if (kind == definition.name) return definition.make(recording, kind, arguments);
    known.emplace_back(definition.name);
  }
  for (const char* group : {"sensors", "actuators", "registers"})
    for (const std::string& name : recording.channel_names(group)) {
      if (kind == name) return channel_series(recording, group, name, arguments);
      if (std::ranges::find(known, name) == known.end()) known.push_back(name);
    }
  for (const std::string& name : recording.metric_names()) {
    if (kind != name) {
      known.push_back(name);
      continue;
    }
    require_no_arguments(kind, arguments);
    return metric_series(recording, "metric", {name});
  }
  throw_plot_error(kind,
                   "unknown kind of plot; known: " + common::join(known) + common::did_you_mean(kind, known));
}

}  // namespace smartsurf::record
