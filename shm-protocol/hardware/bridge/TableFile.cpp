#include "shm-protocol/hardware/bridge/TableFile.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "shm-protocol/hardware/bridge/TomlReader.h"

namespace hardware {
namespace {

constexpr const char* kText = "a text in quotation marks";

TableBoard read_board(const TomlReader& reader, const toml::table& table) {
  TableBoard board;
  board.line = TomlReader::line_of(table);
  board.id = reader.get<std::string>(table, "board: ", "id", kText).value_or("");
  if (board.id.size() > 16)
    reader.fail(board.line, "board '" + board.id + "': an id has at most 16 characters");
  const std::string where = board.id.empty() ? "board: " : "board '" + board.id + "': ";
  reader.allow(table, where, {"id", "device", "baud", "at", "turn", "mirror", "size", "without"});
  const auto device = reader.need<std::string>(table, where, "device", "a serial line or tcp:HOST:PORT");
  const auto baud =
      reader.get<std::int64_t>(table, where, "baud", "a speed in bits a second").value_or(115200);
  if (!PortAddress::is_usual_speed(baud))
    reader.fail(TomlReader::line_of(*table.get("baud")), where + "baud is " + std::to_string(baud) +
                                                             ", must be a usual speed in bits a second; " +
                                                             PortAddress::kUsualSpeeds);
  try {
    board.port = PortAddress::parse(device, static_cast<unsigned>(baud));
  } catch (const std::invalid_argument& e) {
    reader.fail(board.line, where + e.what());
  }
  const auto at = reader.pair(table, where, "at", 0);
  if (!at)
    reader.fail(board.line, where + "at is missing: [row, column] of its north-west cell in the table");
  std::tie(board.row, board.column) = *at;
  const auto turn = reader.get<std::int64_t>(table, where, "turn", "0, 90, 180 or 270").value_or(0);
  if (turn != 0 && turn != 90 && turn != 180 && turn != 270)
    reader.fail(
        TomlReader::line_of(*table.get("turn")),
        where + "turn is " + std::to_string(turn) + ", must be 0, 90, 180 or 270 (counter-clockwise)");
  board.turn = static_cast<int>(turn);
  board.mirror = reader.get<bool>(table, where, "mirror", "true or false").value_or(false);
  board.size = reader.pair(table, where, "size", 1);
  if (const toml::node* node = table.get("without")) {
    const toml::array* names = node->as_array();
    if (!names) reader.fail(TomlReader::line_of(*node), where + "without must be a list of channels");
    for (const toml::node& name : *names) {
      const auto text = name.value_exact<std::string>();
      if (!text) reader.fail(TomlReader::line_of(name), where + "without must be a list of channels");
      board.without.push_back(*text);
    }
  }
  return board;
}

}  // namespace

std::string TableSpec::place(const TableBoard& board) const {
  return file + ":" + std::to_string(board.line) + ": board '" + board.title() + "': ";
}

TableSpec read_table(const std::filesystem::path& path) {
  TableSpec spec;
  spec.file = path.string();
  const TomlReader reader(spec.file);
  const toml::table table = reader.parse(std::size_t{1} << 24);
  reader.allow(table, "", {"name", "pitch", "period_us", "holes", "calibration", "board"});
  spec.name = reader.need<std::string>(table, "", "name", kText);
  spec.name_line = TomlReader::line_of(*table.get("name"));
  spec.pitch = reader.number(table, "", "pitch", "a length above 0");
  if (spec.pitch && !(std::isfinite(*spec.pitch) && *spec.pitch > 0))
    reader.fail(TomlReader::line_of(*table.get("pitch")), "pitch must be a length above 0");
  const auto period =
      reader.need<std::int64_t>(table, "", "period_us", "the control period in µs, 100 to 60000000");
  if (period < 100 || period > 60'000'000)
    reader.fail(
        TomlReader::line_of(*table.get("period_us")),
        "period_us is " + std::to_string(period) + ", must be the control period in µs, 100 to 60000000");
  spec.period_us = static_cast<std::uint32_t>(period);
  spec.holes = reader.get<bool>(table, "", "holes", "true or false").value_or(false);
  if (const auto calibration = reader.get<std::string>(table, "", "calibration", kText)) {
    if (calibration->empty())
      reader.fail(TomlReader::line_of(*table.get("calibration")), "calibration is empty: must name a file");
    spec.calibration = (path.parent_path() / *calibration).string();
  }
  const toml::node* const boards = table.get("board");
  if (!boards) throw std::invalid_argument(spec.file + ": has no [[board]]");
  if (!boards->is_array_of_tables())
    reader.fail(TomlReader::line_of(*boards), "board must be [[board]] tables");
  for (const toml::node& board : *boards->as_array())
    spec.boards.push_back(read_board(reader, *board.as_table()));
  for (std::size_t i = 0; i < spec.boards.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const TableBoard &a = spec.boards[j], &b = spec.boards[i];
      if (!b.id.empty() && a.id == b.id)
        reader.fail(b.line,
                    "board '" + b.id + "': line " + std::to_string(a.line) + " has a board of the same id");
      if (a.port.text == b.port.text)
        reader.fail(b.line, "board '" + b.title() + "': device " + b.port.text + " is also that of line " +
                                std::to_string(a.line));
    }
  return spec;
}

}  // namespace hardware
