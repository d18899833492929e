#include "smartsurf/web/Page.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "common/files/AtomicFile.h"
#include "smartsurf/web/Assets.h"
#include "smartsurf/web/FramePacker.h"

namespace smartsurf::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using record::Recording;

constexpr std::size_t kMostBytes = std::size_t{400} << 20;  // unpacked, in the browser's memory
constexpr const char* kShapes[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};

// The recorded frames that the page shows.
std::vector<std::size_t> choose_frames(const Recording& recording, double frames_per_second) {
  std::vector<std::size_t> chosen;
  double due_s = -std::numeric_limits<double>::infinity();
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
    const double now_s = recording.times()[frame];
    if (now_s < due_s - 1e-6 && frame + 1 < recording.frames()) continue;
    chosen.push_back(frame);
    due_s = std::isfinite(due_s) ? std::max(due_s + 1.0 / frames_per_second, now_s)
                                 : now_s + 1.0 / frames_per_second;
  }
  return chosen;
}

// One channel over the cells, and where its frames come from.
struct Cells {
  std::string name, group;
  PackedSeries layout;
};

// The least and greatest number in the frames.
std::pair<double, double> range_of(const Recording& recording, const Cells& cells,
                                   const std::vector<std::size_t>& frames) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const std::size_t frame : frames)
    for (const float value : recording.read_channel(cells.group, cells.name, frame)) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, double{value});
      high = std::max(high, double{value});
    }
  if (!(low <= high)) return {0.0, 1.0};
  return {low, low < high ? high : low + 1.0};
}

std::vector<Cells> cells_of(const Recording& recording, const std::vector<std::size_t>& frames) {
  const scene::SurfaceSpec& surface = recording.spec().surface;
  const std::size_t count = static_cast<std::size_t>(surface.cell_count());
  std::vector<Cells> all;
  if (recording.has_heights()) {
    const double top =
        std::max(surface.pin.max_height, surface.border_height.value_or(surface.pin.max_height));
    all.push_back({"height", "", {surface.pin.min_height, top, 1, count}});
  }
  for (const char* group : {"sensors", "actuators"})
    for (const std::string& name : recording.channel_names(group)) {
      Cells cells{name, group, {0.0, 1.0, 1, count}};
      if (recording.read_channel(group, name, frames.front()).size() != count)
        continue;  // of several components
      std::tie(cells.layout.low, cells.layout.high) = range_of(recording, cells, frames);
      all.push_back(cells);
    }
  return all;
}

PackedSeries position_layout(const Recording& recording, const std::vector<std::size_t>& frames) {
  PackedSeries layout{0.0, 1.0, 2, 3 * recording.spec().objects.size()};
  layout.low = std::numeric_limits<double>::infinity();
  layout.high = -layout.low;
  for (const std::size_t frame : frames)
    for (const float value : recording.read_positions(frame, 1)) {
      // What has fallen off for long is nowhere that anybody looks.
      if (!std::isfinite(value) || std::abs(value) > 1e4F) continue;
      layout.low = std::min(layout.low, double{value});
      layout.high = std::max(layout.high, double{value});
    }
  if (!(layout.low < layout.high)) layout.low = 0.0, layout.high = 1.0;
  return layout;
}

json series_json(const std::string& name, const PackedSeries& layout) {
  return {{"name", name},
          {"low", layout.low},
          {"high", layout.high},
          {"bytes", layout.bytes},
          {"values", layout.values}};
}

json objects_json(const Recording& recording) {
  json objects = json::array();
  for (const scene::ObjectSpec& object : recording.spec().objects) {
    const Eigen::Vector3d half = object.half_extents();
    json entry = {{"shape", kShapes[static_cast<int>(object.shape)]},
                  {"half", {half.x(), half.y(), half.z()}},
                  {"radius", object.radius},
                  {"height", object.height},
                  {"colour", {object.colour.r, object.colour.g, object.colour.b}},
                  {"label", object.label}};
    if (object.solid && object.shape == scene::ShapeKind::kSolid) {
      json vertices = json::array(), triangles = json::array();
      for (const Eigen::Vector3f& v : object.solid->vertices)
        vertices.insert(vertices.end(), {v.x(), v.y(), v.z()});
      for (const auto& t : object.solid->triangles) triangles.insert(triangles.end(), {t[0], t[1], t[2]});
      entry["vertices"] = std::move(vertices);
      entry["triangles"] = std::move(triangles);
    }
    objects.push_back(std::move(entry));
  }
  return objects;
}

// Of a layout that is no rectangular grid: x, y and angle of each cell.
json places_json(const scene::SurfaceSpec& surface) {
  if (surface.cell_poses.empty()) return {};
  json all = json::array();
  for (const scene::CellPose& place : surface.cell_poses)
    all.insert(all.end(), {place.x, place.y, place.angle});
  return all;
}

json mechanisms_json(const scene::SurfaceSpec& surface) {
  json all = json::array();
  for (const scene::ActuatorSpec& spec : surface.effective_actuators()) {
    json one = {{"model", spec.model}};
    for (const auto& [name, values] : spec.values) one[name] = values;
    all.push_back(std::move(one));
  }
  return all;
}

json scene_json(const Recording& recording, const std::vector<std::size_t>& frames) {
  const scene::SurfaceSpec& s = recording.spec().surface;
  json time = json::array();
  for (const std::size_t frame : frames) time.push_back(recording.times()[frame]);
  return {{"title", fs::path(recording.spec().file).filename().string()},
          {"seed", recording.spec().world.seed},
          {"rows", s.rows},
          {"columns", s.columns},
          {"pitch", s.pitch},
          {"top", {s.pin.top_x, s.pin.top_y}},
          {"length", s.pin.length},
          {"low", s.pin.min_height},
          {"high", s.pin.max_height},
          {"border", s.border_height ? json(*s.border_height) : json()},
          {"place", places_json(s)},
          {"cell", s.actuator_of_cell.empty() ? json() : json(s.actuator_of_cell)},
          {"mechanisms", mechanisms_json(s)},
          {"time", std::move(time)},
          {"objects", objects_json(recording)}};
}

void append(std::vector<std::uint8_t>& all, const SeriesPacker& packer) {
  all.insert(all.end(), packer.bytes().begin(), packer.bytes().end());
}

void pack_objects(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                  std::vector<std::uint8_t>& all) {
  const std::size_t objects = recording.spec().objects.size();
  if (!recording.has_objects() || objects == 0) return;
  SeriesPacker positions(position_layout(recording, frames)), turns({-1.0, 1.0, 2, 4 * objects});
  std::vector<float> turn(4 * objects);
  for (const std::size_t frame : frames) {
    positions.add(recording.read_positions(frame, 1));
    const scene::Snapshot shot = recording.read_snapshot(frame);
    std::fill(turn.begin(), turn.end(), std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0; i < shot.object_count(); ++i)
      std::copy(shot.orientation[i].begin(), shot.orientation[i].end(),
                turn.begin() + static_cast<std::ptrdiff_t>(4 * shot.id[i]));
    turns.add(turn);
  }
  series.push_back(series_json("position", positions.layout()));
  series.push_back(series_json("orientation", turns.layout()));
  append(all, positions);
  append(all, turns);
}

void pack_cells(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                std::vector<std::uint8_t>& all) {
  for (const Cells& cells : cells_of(recording, frames)) {
    SeriesPacker packer(cells.layout);
    for (const std::size_t frame : frames)
      if (cells.group.empty())
        packer.add(recording.read_heights(frame));
      else
        packer.add(recording.read_channel(cells.group, cells.name, frame));
    series.push_back(
        series_json(cells.group.empty() ? "height" : cells.group + "/" + cells.name, packer.layout()));
    append(all, packer);
  }
}

// What the mechanisms look like. Turns go round: the page needs where they are, not how often they went.
void pack_motion(const Recording& recording, const std::vector<std::size_t>& frames, json& series,
                 std::vector<std::uint8_t>& all) {
  if (!recording.has_motion()) return;
  constexpr double kHalfTurn = std::numbers::pi;
  const std::size_t cells = static_cast<std::size_t>(recording.spec().surface.cell_count());
  SeriesPacker packer({-kHalfTurn, kHalfTurn, 2, 3 * cells});
  std::vector<float> numbers(3 * cells);
  const auto round = [](float angle) { return std::remainder(angle, 2.0F * static_cast<float>(kHalfTurn)); };
  for (const std::size_t frame : frames) {
    const scene::Snapshot shot = recording.read_snapshot(frame);
    for (std::size_t i = 0; i < shot.actuator_state.size(); ++i) {
      numbers[3 * i] = round(shot.actuator_state[i].a);
      numbers[3 * i + 1] = round(shot.actuator_state[i].b);
      numbers[3 * i + 2] = shot.actuator_state[i].level;
    }
    packer.add(numbers);
  }
  series.push_back(series_json("motion", packer.layout()));
  append(all, packer);
}

void require_room(const Recording& recording, std::size_t frames) {
  std::size_t a_frame = 14 * recording.spec().objects.size();
  const std::size_t cells = static_cast<std::size_t>(recording.spec().surface.cell_count());
  a_frame += cells * (1 + (recording.has_motion() ? 6 : 0) + recording.channel_names("sensors").size() +
                      recording.channel_names("actuators").size());
  if (a_frame * frames <= kMostBytes) return;
  const double fits = static_cast<double>(kMostBytes) / static_cast<double>(a_frame * frames);
  throw scene::InputError(recording.path().string() + ": " + std::to_string(frames) +
                          " frames are too many for a page; --fps of " + std::to_string(fits) +
                          " times as many would fit");
}

// The text with every {{NAME}} replaced; nothing that is put in is looked at again.
std::string fill_in(std::string_view text,
                    const std::vector<std::pair<std::string_view, std::string_view>>& values) {
  std::string page;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t open = text.find("{{", at);
    page += text.substr(at, open - at);
    if (open == text.npos) break;
    const std::size_t close = text.find("}}", open);
    const std::string_view name = text.substr(open + 2, close - open - 2);
    for (const auto& [known, value] : values)
      if (known == name) page += value;
    at = close + 2;
  }
  return page;
}

// Text in an HTML element: neither ends it nor begins one.
std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) safe += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
  return safe;
}

// JSON inside of a script element, which "</script" would end.
std::string script_safe(const json& value) {
  std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != text.npos; at += 6) text.replace(at, 1, "\\u003c");
  return text;
}

}  // namespace

void write_page(const Recording& recording, const fs::path& path, const PageOptions& options) {
  if (recording.frames() == 0 || !(recording.has_objects() || recording.has_heights()))
    throw scene::InputError(recording.path().string() + ": holds nothing to show");
  const std::vector<std::size_t> frames = choose_frames(recording, options.frames_per_second);
  require_room(recording, frames.size());
  json scene = scene_json(recording, frames), series = json::array();
  std::vector<std::uint8_t> all;
  pack_objects(recording, frames, series, all);
  pack_cells(recording, frames, series, all);
  pack_motion(recording, frames, series, all);
  scene["series"] = std::move(series);
  const std::string data = base64(compress(all)), description = script_safe(scene);
  const std::string page = fill_in(page_html(), {{"TITLE", escaped(scene["title"])},
                                                 {"SCENE", description},
                                                 {"FRAMES", data},
                                                 {"LICENCE", three_licence()},
                                                 {"THREE", three_js()},
                                                 {"ORBIT", orbit_controls_js()},
                                                 {"MECHANISMS", mechanisms_js()},
                                                 {"PLAYER", player_js()}});
  if (const std::error_code error = common::replace_file(path, page))
    throw scene::InputError(path.string() + ": cannot be written: " + error.message());
}

}  // namespace smartsurf::web
