#include "smartsurf/surface/FaultMap.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "smartsurf/surface/CsvTable.h"

namespace smartsurf::surface {

FaultMap::FaultMap(const scene::FaultMapFile& file, int rows, int columns) : name_(file.name) {
  std::map<std::array<std::string, 4>, std::pair<int, std::string>> seen;
  for (const CsvLine& line : read_csv(file.name, file.text, "row,column,channel,fault,value", 1)) {
    if (line.text(3).empty()) line.refuse("fault: must not be empty");
    std::optional<double> value;
    if (!line.text(4).empty()) value = line.number(4, "value");
    // A cell cannot be stuck and dead at once, nor stuck at two values.
    const std::string kind = line.text(3) == "dead" ? "stuck" : line.text(3);
    const auto [first, is_new] = seen.try_emplace({line.text(0), line.text(1), line.text(2), kind},
                                                  std::pair(line.line(), line.text(3)));
    if (!is_new)
      line.refuse("fault " + in_quotes(line.text(3)) + ": the cell is " + first->second.second +
                  " already, by line " + std::to_string(first->second.first));
    entries_.push_back({line.index(0, "row", rows), line.index(1, "column", columns), line.text(2),
                        line.text(3), value, line.line()});
  }
}

void FaultMap::refuse(const FaultEntry& entry, const std::string& clause) const {
  throw scene::InputError(name_ + ":" + std::to_string(entry.line) + ": " + clause);
}

void FaultMap::require_channels(const std::vector<std::string>& known) const {
  for (const FaultEntry& entry : entries_) {
    if (entry.channel.empty() || std::ranges::find(known, entry.channel) != known.end()) continue;
    std::string near = scene::nearest_name(entry.channel, known), all;
    for (const std::string& name : known) all += (all.empty() ? "" : ", ") + name;
    refuse(entry, "channel " + in_quotes(entry.channel) + ": no such channel" +
                      (near.empty() ? "; known: " + all : " (did you mean '" + near + "'?)"));
  }
}

}  // namespace smartsurf::surface
