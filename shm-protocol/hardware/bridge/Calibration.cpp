#include "shm-protocol/hardware/bridge/Calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "common/chart/CellMaps.h"
#include "common/text/Number.h"
#include "common/text/Words.h"
#include "shm-protocol/hardware/bridge/TomlReader.h"

namespace hardware {
namespace {

constexpr const char* kFormat = "smartsurf calibration 1";
constexpr const char* kStateNames[] = {"good", "stuck", "dead", "absent"};
constexpr std::size_t kMaxBytes = std::size_t{1} << 28;
// The bounds of values and errors in a file, and of slopes.
constexpr double kMaxValue = 1e6, kMinSlope = 0.1;
// May not be more than the range of the actuator.
constexpr CellFit::Parameter kLengths[] = {CellFit::kZero, CellFit::kPlay, CellFit::kSensorZero};

bool may_be_negative(std::size_t parameter) {
  return parameter < CellFit::kPlay || parameter > CellFit::kDelay;
}

std::string number(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.6g", value);
  std::string text = digits;
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string place_text(const Calibration::Place& board) {
  return "board" + (board.id.empty() ? "" : " '" + board.id + "'") + " at [" + std::to_string(board.row) +
         ", " + std::to_string(board.column) + "], turn " + std::to_string(board.turn) +
         (board.mirror ? ", mirrored" : "");
}

Calibration::Place read_place(const TomlReader& reader, const toml::table& table) {
  Calibration::Place board;
  board.line = TomlReader::line_of(table);
  reader.allow(table, "board: ", {"id", "at", "turn", "mirror"});
  board.id = reader.get<std::string>(table, "board: ", "id", "a text").value_or("");
  const auto at = reader.pair(table, "board: ", "at", 0);
  if (!at) reader.fail(board.line, "board: at is missing: [row, column]");
  std::tie(board.row, board.column) = *at;
  board.turn =
      static_cast<int>(reader.get<std::int64_t>(table, "board: ", "turn", "0, 90, 180 or 270").value_or(0));
  board.mirror = reader.get<bool>(table, "board: ", "mirror", "true or false").value_or(false);
  return board;
}

// Calls use(cell, value) for each number of a matrix of the table's size.
template <class Use>
void read_map(const TomlReader& reader, const toml::table& section, const std::string& where, const char* key,
              const Calibration& c, double most, const std::string& possible, Use use) {
  const toml::node* node = section.get(key);
  if (!node) reader.fail(TomlReader::line_of(section), where + key + " is missing: a row of numbers per row");
  const auto wrong = [&](std::size_t line, const std::string& what) {
    reader.fail(line, where + key + what + "; " + std::to_string(c.rows) + " rows of " +
                          std::to_string(c.columns) + " numbers are needed");
  };
  const toml::array* rows = node->as_array();
  if (!rows || rows->size() != c.rows)
    wrong(TomlReader::line_of(*node),
          rows ? " has " + std::to_string(rows->size()) + " rows" : " is not a list");
  std::size_t cell = 0;
  for (const toml::node& row : *rows) {
    const toml::array* values = row.as_array();
    if (!values || values->size() != c.columns)
      wrong(TomlReader::line_of(row),
            values ? " has a row of " + std::to_string(values->size()) : " has a row that is not a list");
    for (const toml::node& value : *values) {
      const auto v = value.value<double>();
      if (!value.is_number() || !v || !(std::abs(*v) <= most))
        reader.fail(TomlReader::line_of(value), where + key + " of row " + std::to_string(cell / c.columns) +
                                                    ", column " + std::to_string(cell % c.columns) + " is " +
                                                    (v ? number(*v) : std::string("not a number")) +
                                                    ", must be " + possible);
      use(cell++, *v, TomlReader::line_of(value));
    }
  }
}

std::vector<std::string_view> keys_of_file() {
  std::vector<std::string_view> keys{"format",    "table", "actuator", "sensor", "unit",
                                     "period_us", "rest",  "size",     "board",  "state"};
  for (const CellParameter& parameter : kCellParameters) keys.push_back(parameter.name);
  return keys;
}

const toml::table& section_of(const TomlReader& reader, const toml::table& file, const char* name) {
  const toml::node* node = file.get(name);
  if (!node || !node->is_table())
    reader.fail(node ? TomlReader::line_of(*node) : TomlReader::line_of(file),
                std::string("[") + name + "] is missing: the file is not whole");
  return *node->as_table();
}

}  // namespace

bool is_usable(const CellFit& fit, double range) {
  for (std::size_t p = 0; p < CellFit::kCount; ++p) {
    const double v = fit.value[p], error = fit.error[p];
    if (!(std::abs(v) <= kMaxValue) || !(error >= 0 && error <= kMaxValue)) return false;
    if (v < 0 && !may_be_negative(p)) return false;
  }
  return std::abs(fit.value[CellFit::kSlope]) >= kMinSlope &&
         std::ranges::all_of(kLengths, [&](auto p) { return std::abs(fit.value[p]) <= range; });
}

Calibration Calibration::read(const std::filesystem::path& path) {
  Calibration c;
  c.file = path.string();
  const TomlReader reader(c.file);
  const toml::table file = reader.parse(kMaxBytes);
  for (const auto& [key, node] : file) c.lines[std::string(key.str())] = key.source().begin.line;
  if (reader.need<std::string>(file, "", "format", "\"smartsurf calibration 1\"") != kFormat)
    reader.fail(TomlReader::line_of(*file.get("format")), std::string("format must be \"") + kFormat + "\"");
  reader.allow(file, "", keys_of_file());
  c.table = reader.need<std::string>(file, "", "table", "a text");
  c.actuator = reader.need<std::string>(file, "", "actuator", "a text");
  c.sensor = reader.need<std::string>(file, "", "sensor", "a text");
  c.unit = reader.need<std::string>(file, "", "unit", "a text");
  c.has_rest = reader.need<bool>(file, "", "rest", "true or false");
  const auto size = reader.pair(file, "", "size", 1);
  if (!size) reader.fail(TomlReader::line_of(file), "size is missing: [rows, columns]");
  std::tie(c.rows, c.columns) = *size;
  c.period_us = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      reader.need<std::int64_t>(file, "", "period_us", "a time in µs"), 0, 60'000'000));
  const toml::node* boards = file.get("board");
  if (!boards || !boards->is_array_of_tables())
    reader.fail(TomlReader::line_of(file), "has no [[board]]: the file is not whole");
  for (const toml::node& board : *boards->as_array())
    c.boards.push_back(read_place(reader, *board.as_table()));

  // Before the planes are made: a row that the file has limits what it can ask for.
  const toml::table& states = section_of(reader, file, "state");
  reader.allow(states, "state: ", {"value"});
  const toml::node* first = states.get("value");
  if (!first || !first->is_array() || first->as_array()->size() != c.rows)
    reader.fail(TomlReader::line_of(states), "state: value must have " + std::to_string(c.rows) + " rows");
  if (const toml::array* row = (*first->as_array())[0].as_array(); !row || row->size() != c.columns)
    reader.fail(TomlReader::line_of(*first),
                "state: value must have " + std::to_string(c.columns) + " columns");
  c.fits.resize(c.cells());
  constexpr const char* kStates = "0, 1, 2 or 3";
  read_map(reader, states, "state: ", "value", c, 3, kStates,
           [&](std::size_t cell, double v, std::size_t line) {
             if (v != std::floor(v) || v < 0)
               reader.fail(line, "state: " + number(v) + " must be " + kStates);
             c.fits[cell].state = static_cast<CellState>(static_cast<int>(v));
           });
  const std::string possible = "a number from -" + number(kMaxValue) + " to " + number(kMaxValue);
  for (std::size_t p = 0; p < CellFit::kCount; ++p) {
    const std::string where = std::string(kCellParameters[p].name) + ": ";
    const toml::table& section = section_of(reader, file, kCellParameters[p].name);
    reader.allow(section, where, {"value", "error"});
    read_map(reader, section, where, "value", c, kMaxValue, possible,
             [&](std::size_t cell, double v, std::size_t line) {
               if (p == CellFit::kSlope && std::abs(v) < kMinSlope)
                 reader.fail(line, "slope: " + number(v) + " must be at least 0.1, or at most -0.1");
               if (v < 0 && !may_be_negative(p))
                 reader.fail(line, where + number(v) + " must not be negative");
               c.fits[cell].value[p] = v;
             });
    read_map(reader, section, where, "error", c, kMaxValue, possible,
             [&](std::size_t cell, double v, std::size_t line) {
               if (v < 0) reader.fail(line, where + "error " + number(v) + " must not be negative");
               c.fits[cell].error[p] = v;
             });
  }
  c.last_.assign(c.cells(), std::numeric_limits<float>::quiet_NaN());
  c.upwards_.assign(c.cells(), 0);
  return c;
}

std::string Calibration::text() const {
  std::string all =
      "# Written by surface_bridge calibrate. Matrices have a line per row of cells, the first one north.\n"
      "# state: 0 good, 1 stuck, 2 dead, 3 absent. error: standard errors; 0: the value is not measured.\n"
      "format = " +
      common::toml_text(kFormat) + "\ntable = " + common::toml_text(table) +
      "\nactuator = " + common::toml_text(actuator) + "\nsensor = " + common::toml_text(sensor) +
      "\nunit = " + common::toml_text(unit) + "\nperiod_us = " + std::to_string(period_us) +
      "\nrest = " + (has_rest ? "true" : "false") + "\nsize = [" + std::to_string(rows) + ", " +
      std::to_string(columns) + "]\n";
  for (const Place& b : boards)
    all += "\n[[board]]\n" + (b.id.empty() ? "" : "id = " + common::toml_text(b.id) + "\n") + "at = [" +
           std::to_string(b.row) + ", " + std::to_string(b.column) + "]\nturn = " + std::to_string(b.turn) +
           "\nmirror = " + (b.mirror ? "true" : "false") + "\n";
  const auto matrix = [&](const char* name, auto value) {
    all += std::string(name) + " = [\n";
    for (std::size_t cell = 0; cell < cells(); ++cell)
      all += (cell % columns == 0 ? "  [" : ", ") + value(fits[cell]) +
             ((cell + 1) % columns == 0 ? "],\n" : "");
    all += "]\n";
  };
  all += "\n[state]\n";
  matrix("value", [](const CellFit& f) { return std::to_string(static_cast<int>(f.state)); });
  for (std::size_t p = 0; p < CellFit::kCount; ++p) {
    all += std::string("\n[") + kCellParameters[p].name + "]\n";
    matrix("value", [&](const CellFit& f) { return common::shortest(f.value[p]); });
    matrix("error", [&](const CellFit& f) { return common::shortest(static_cast<float>(f.error[p])); });
  }
  return all;
}

std::size_t Calibration::line_of(const std::string& key) const {
  const auto line = lines.find(key);
  return line == lines.end() ? 0 : line->second;
}

std::string Calibration::place(std::size_t line) const {
  return file + (line ? ":" + std::to_string(line) : "") + ": ";
}

void Calibration::require_table(const TableSpec& spec) const {
  const auto another = [&](std::size_t line, const std::string& what) {
    throw std::invalid_argument(place(line) + "is the calibration of another table: " + what);
  };
  if (period_us != spec.period_us)
    another(line_of("period_us"), "period_us is " + std::to_string(period_us) + ", that of " + spec.file +
                                      " is " + std::to_string(spec.period_us));
  for (const Place& b : boards) {
    const auto here = std::ranges::find_if(spec.boards, [&](const TableBoard& t) {
      return t.id == b.id && t.row == b.row && t.column == b.column && t.turn == b.turn &&
             t.mirror == b.mirror;
    });
    if (here == spec.boards.end()) another(b.line, spec.file + " has no " + place_text(b));
  }
  for (const TableBoard& t : spec.boards) {
    const Place wanted{t.id, t.row, t.column, t.turn, t.mirror};
    if (std::ranges::none_of(
            boards, [&](const Place& b) { return t.id == b.id && t.row == b.row && t.column == b.column; }))
      another(line_of("board"),
              "it has no " + place_text(wanted) + " (" + spec.file + ":" + std::to_string(t.line) + ")");
  }
}

void Calibration::require_map(const TableMap& map) {
  if (map.rows() != rows || map.columns() != columns)
    throw std::invalid_argument(place(line_of("size")) + "is the calibration of another table: of " +
                                std::to_string(rows) + " rows of " + std::to_string(columns) +
                                " cells, not " + std::to_string(map.rows()) + " of " +
                                std::to_string(map.columns()));
  const auto require = [&](const std::string& name, bool is_sensor) -> const TableChannel& {
    for (const TableChannel& c : map.channels())
      if (c.sensor == is_sensor && c.name == name && c.components == 1 && c.unit == unit) return c;
    throw std::invalid_argument(place(line_of(is_sensor ? "sensor" : "actuator")) + "the table has no " +
                                (is_sensor ? "sensor '" : "actuator '") + name + "' of one component in '" +
                                unit + "'");
  };
  require(sensor, true);
  const TableChannel& channel = require(actuator, false);
  const double range = static_cast<double>(channel.maximum) - static_cast<double>(channel.minimum);
  for (std::size_t cell = 0; cell < cells(); ++cell)
    for (const auto p : kLengths)
      if (std::abs(fits[cell].value[p]) > range)
        throw std::invalid_argument(place(line_of(kCellParameters[p].name)) + kCellParameters[p].name +
                                    " of row " + std::to_string(cell / columns) + ", column " +
                                    std::to_string(cell % columns) + " is " + number(fits[cell].value[p]) +
                                    ", more than the whole range of '" + actuator + "', " + number(range));
}

void Calibration::correct_readings(const MountedBoard& board, std::span<float> readings) const {
  for (std::size_t i = 0; i < board.cells.size(); ++i)
    if (const std::uint32_t cell = board.cells[i]; board.exists[i])
      readings[cell] -= static_cast<float>(fits[cell].value[CellFit::kSensorZero]);
}

void Calibration::note_height(std::size_t cell, float height) {
  if (height > last_[cell]) upwards_[cell] = 1;
  if (height < last_[cell]) upwards_[cell] = -1;
  last_[cell] = height;
}

void Calibration::correct_commands(const MountedBoard& board, std::span<float> heights) {
  for (std::size_t i = 0; i < board.cells.size(); ++i) {
    const std::uint32_t cell = board.cells[i];
    if (!board.exists[i]) continue;
    const auto& v = fits[cell].value;
    note_height(cell, heights[cell]);
    heights[cell] = static_cast<float>(
        (static_cast<double>(heights[cell]) - v[CellFit::kZero] + 0.5 * upwards_[cell] * v[CellFit::kPlay]) /
        v[CellFit::kSlope]);
  }
}

void Calibration::note_own_command(const MountedBoard& board, float command) {
  for (std::size_t i = 0; i < board.cells.size(); ++i) {
    const std::uint32_t cell = board.cells[i];
    const auto& v = fits[cell].value;
    const double w = v[CellFit::kZero] + v[CellFit::kSlope] * static_cast<double>(command),
                 half = 0.5 * v[CellFit::kPlay], last = static_cast<double>(last_[cell]);
    note_height(cell, static_cast<float>(std::isnan(last) ? w : std::clamp(last, w - half, w + half)));
  }
}

std::vector<std::string> cells_to_adjust(const Calibration& c, double lowest, double highest) {
  const double range = highest - lowest;
  const auto typical = [&](CellFit::Parameter p) {
    std::vector<double> values;
    for (const CellFit& fit : c.fits)
      if (fit.state == CellState::kGood && fit.value[p] > 0) values.push_back(fit.value[p]);
    if (values.empty()) return 0.0;
    std::ranges::nth_element(values, values.begin() + std::ssize(values) / 2);
    return values[values.size() / 2];
  };
  const double up = typical(CellFit::kSpeedUp), down = typical(CellFit::kSpeedDown),
               lag = typical(CellFit::kLag), noise = typical(CellFit::kNoise);
  std::vector<std::string> list;
  for (std::size_t cell = 0; cell < c.cells(); ++cell) {
    const CellFit& fit = c.fits[cell];
    if (fit.state == CellState::kAbsent) continue;
    const auto& v = fit.value;
    std::string why;
    const auto add = [&](const std::string& what) { why += (why.empty() ? "" : "; ") + what; };
    if (fit.state != CellState::kGood) {
      add(kStateNames[static_cast<int>(fit.state)]);
    } else {
      if (const double end = v[CellFit::kZero] + v[CellFit::kSlope] * highest; end < highest - 0.1 * range)
        add("reaches " + number(end) + " " + c.unit + " of " + number(highest));
      if (const double end = v[CellFit::kZero] + v[CellFit::kSlope] * lowest; end > lowest + 0.1 * range)
        add("cannot go below " + number(end) + " " + c.unit);
      if (v[CellFit::kPlay] > 0.05 * range) add("dead band " + number(v[CellFit::kPlay]) + " " + c.unit);
      if (v[CellFit::kSpeedUp] > 0 && v[CellFit::kSpeedUp] < 0.5 * up) add("slow upwards");
      if (v[CellFit::kSpeedDown] > 0 && v[CellFit::kSpeedDown] < 0.5 * down) add("slow downwards");
      if (v[CellFit::kLag] > 3 * lag) add("sluggish");
      if (v[CellFit::kNoise] > 4 * noise) add("noisy sensor");
    }
    if (!why.empty())
      list.push_back("row " + std::to_string(cell / c.columns) + " column " +
                     std::to_string(cell % c.columns) + ": " + why);
  }
  return list;
}

std::string calibration_maps(const Calibration& c) {
  std::vector<common::CellMap> maps{{"state: 0 good, 1 stuck, 2 dead, 3 absent", {}}};
  for (const CellFit& fit : c.fits) maps[0].values.push_back(static_cast<double>(fit.state));
  for (std::size_t p = 0; p < CellFit::kCount; ++p) {
    const CellParameter& parameter = kCellParameters[p];
    std::string unit = parameter.length ? c.unit : "";
    if (parameter.time == 1) unit = "s";
    if (parameter.time == -1) unit += "/s";
    common::CellMap map{std::string(parameter.title) + (unit.empty() ? "" : ", " + unit), {}};
    const bool zero_is_nothing = p == CellFit::kSpeedUp || p == CellFit::kSpeedDown;
    for (const CellFit& fit : c.fits)
      map.values.push_back(fit.state != CellState::kGood || (zero_is_nothing && fit.value[p] == 0)
                               ? std::numeric_limits<double>::quiet_NaN()
                               : fit.value[p]);
    maps.push_back(std::move(map));
  }
  return common::cell_maps_svg("calibration of table '" + c.table + "'", static_cast<int>(c.rows),
                               static_cast<int>(c.columns), maps);
}

}  // namespace hardware
