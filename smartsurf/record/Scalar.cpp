#include "smartsurf/record/Scalar.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

namespace smartsurf::record {
namespace {

using Arguments = std::vector<std::string>;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void refuse(const std::string& what, const std::string& why) {
  throw scene::InputError("--what " + what + ": " + why);
}

std::optional<std::size_t> whole_number(const std::string& text) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

void take_none(const std::string& kind, const Arguments& arguments) {
  if (!arguments.empty()) refuse(kind + ":" + arguments[0], "takes nothing after '" + kind + "'");
}

struct Cell {
  int row, column;
};

// "ROW,COLUMN", counted from 0, row 0 north.
Cell cell_of(const Recording& recording, const std::string& kind, const std::string& text) {
  const scene::SurfaceSpec& s = recording.spec().surface;
  const auto comma = text.find(',');
  const auto row = whole_number(text.substr(0, comma));
  const auto column = comma == text.npos ? std::nullopt : whole_number(text.substr(comma + 1));
  if (!row || !column) refuse(kind + ":" + text, "must be " + kind + ":ROW,COLUMN");
  if (*row >= static_cast<std::size_t>(s.rows) || *column >= static_cast<std::size_t>(s.columns))
    refuse(kind + ":" + text, "the surface has rows 0 to " + std::to_string(s.rows - 1) +
                                  " and columns 0 to " + std::to_string(s.columns - 1));
  return {static_cast<int>(*row), static_cast<int>(*column)};
}

std::size_t object_of(const Recording& recording, const std::string& kind, const std::string& text) {
  const auto id = whole_number(text);
  const std::size_t objects = recording.spec().objects.size();
  if (!id) refuse(kind + ":" + text, "must be " + kind + ":ID, the number of an object");
  if (*id >= objects)
    refuse(kind + ":" + text, objects == 0 ? std::string("there are no objects")
                                           : "the objects are 0 to " + std::to_string(objects - 1));
  return *id;
}

std::string name_of(const Recording& recording, std::size_t id) {
  const std::string& label = recording.spec().objects[id].label;
  return "object " + std::to_string(id) + (label.empty() ? "" : ", " + label);
}

void require_cells(const std::string& kind, const Arguments& cells) {
  if (cells.empty()) refuse(kind, "of which cell? " + kind + ":ROW,COLUMN");
}

std::string name_of(const Cell& cell) {
  return "row " + std::to_string(cell.row) + ", column " + std::to_string(cell.column);
}

Scalar heights(const Recording& recording, const std::string& kind, const Arguments& cells) {
  require_cells(kind, cells);
  if (!recording.has_heights()) refuse(kind, recording.path().string() + " holds no heights");
  Scalar result{"Height of the actuators", "height [u]", {}};
  std::vector<std::size_t> places;
  for (const std::string& text : cells) {
    const Cell cell = cell_of(recording, kind, text);
    places.push_back(static_cast<std::size_t>(recording.spec().surface.index(cell.row, cell.column)));
    result.curves.push_back({name_of(cell), {}});
  }
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    const std::span<const float> all = recording.heights(frame);
    for (std::size_t i = 0; i < places.size(); ++i) result.curves[i].value.push_back(all[places[i]]);
  }
  return result;
}

Scalar channel(const Recording& recording, const std::string& group, const std::string& name,
               const Arguments& cells) {
  require_cells(name, cells);
  Scalar result{"Channel " + name, name, {}};
  for (const std::string& text : cells) {
    const Cell cell = cell_of(recording, name, text);
    const std::vector<float> values = recording.history(group, name, cell.row, cell.column);
    result.curves.push_back({name_of(cell), {values.begin(), values.end()}});
  }
  return result;
}

// Mean over the movable objects that exist, or one curve for each object asked for. `of` gives the number of
// the object whose three floats begin there; NaN where it does not exist.
template <class Of>
Scalar of_objects(const Recording& recording, const std::string& kind, const Arguments& ids, Scalar result,
                  Of of, std::vector<float> (Recording::*read)(std::size_t, std::size_t) const) {
  const std::size_t objects = recording.spec().objects.size(), frames = recording.frames();
  std::vector<std::size_t> chosen;
  for (const std::string& text : ids) {
    chosen.push_back(object_of(recording, kind, text));
    result.curves.push_back({name_of(recording, chosen.back()), {}});
  }
  if (ids.empty()) result.curves.push_back({"mean", {}});
  const std::size_t block = std::max<std::size_t>(1, (1u << 20) / std::max<std::size_t>(3 * objects, 1));
  for (std::size_t first = 0; first < frames; first += block) {
    const std::size_t count = std::min(block, frames - first);
    const std::vector<float> numbers = (recording.*read)(first, count);
    for (std::size_t f = 0; f < count; ++f) {
      const float* const frame = numbers.data() + f * objects * 3;
      for (std::size_t i = 0; i < chosen.size(); ++i)
        result.curves[i].value.push_back(of(frame + 3 * chosen[i]));
      if (!chosen.empty()) continue;
      double sum = 0.0, there = 0.0;
      for (std::size_t id = 0; id < objects; ++id) {
        const double value = of(frame + 3 * id);
        if (recording.spec().objects[id].fixed || std::isnan(value)) continue;
        sum += value;
        ++there;
      }
      result.curves[0].value.push_back(there > 0.0 ? sum / there : kNone);
    }
  }
  return result;
}

Scalar speed(const Recording& recording, const std::string& kind, const Arguments& ids) {
  return of_objects(
      recording, kind, ids, {"Speed of the objects", ids.empty() ? "mean speed [u/s]" : "speed [u/s]", {}},
      [](const float* v) {
        return std::sqrt(double{v[0]} * v[0] + double{v[1]} * v[1] + double{v[2]} * v[2]);
      },
      &Recording::velocities);
}

Scalar coordinate(const Recording& recording, const std::string& kind, const Arguments& ids) {
  const int axis = kind[0] - 'x';
  return of_objects(
      recording, kind, ids, {"Position of the objects", (ids.empty() ? "mean " : "") + kind + " [u]", {}},
      [axis](const float* p) { return double{p[axis]}; }, &Recording::positions);
}

Scalar objects(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  take_none(kind, arguments);
  const std::size_t all = recording.spec().objects.size();
  Scalar result{"Objects that exist", "objects", {{"objects", {}}}};
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    const std::vector<float> p = recording.positions(frame, 1);
    double there = 0.0;
    for (std::size_t id = 0; id < all; ++id) there += std::isnan(p[3 * id]) ? 0.0 : 1.0;
    result.curves[0].value.push_back(there);
  }
  return result;
}

Scalar contacts(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  take_none(kind, arguments);
  return {"Contact points in each tick's last physics step",
          "contacts",
          {{"contacts", {recording.contacts().begin(), recording.contacts().end()}}}};
}

struct Definition {
  const char* name;
  const char* form;
  Scalar (*make)(const Recording&, const std::string& kind, const Arguments&);
};
// A new scalar is a function and a line here.
constexpr Definition kDefinitions[] = {{"speed", "speed[:ID…]", speed},
                                       {"x", "x[:ID…]", coordinate},
                                       {"y", "y[:ID…]", coordinate},
                                       {"z", "z[:ID…]", coordinate},
                                       {"objects", "objects", objects},
                                       {"contacts", "contacts", contacts},
                                       {"height", "height:ROW,COLUMN…", heights}};

}  // namespace

std::vector<std::string> scalar_kinds() {
  std::vector<std::string> forms;
  for (const Definition& definition : kDefinitions) forms.emplace_back(definition.form);
  return forms;
}

Scalar scalar(const Recording& recording, const std::string& kind, const Arguments& arguments) {
  std::vector<std::string> known = {"trajectories", "purity", "time-spent"};
  for (const Definition& definition : kDefinitions) {
    if (kind == definition.name) return definition.make(recording, kind, arguments);
    known.emplace_back(definition.name);
  }
  for (const char* group : {"sensors", "actuators"})
    for (const std::string& name : recording.channels(group)) {
      if (kind == name) return channel(recording, group, name, arguments);
      if (std::ranges::find(known, name) == known.end()) known.push_back(name);
    }
  const std::string near = scene::nearest_name(kind, known);
  std::string list;
  for (const std::string& name : known) list += (list.empty() ? "" : ", ") + name;
  refuse(kind, "no such figure; known are " + list + (near.empty() ? "" : "; did you mean '" + near + "'?"));
}

}  // namespace smartsurf::record
