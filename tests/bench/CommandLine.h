// Command-line parsing shared by the benchmarks.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace bench {

// Parses the arguments. Exits after --help; prints one line and exits with status 2 if an argument is
// invalid.
inline void parse_or_exit(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& wanted) {
    std::exit(app.exit(wanted));
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "%s: error: %s (see --help)\n", app.get_name().c_str(), error.what());
    std::exit(2);
  }
}

// Accepts only the names of the list's elements.
template <class List, class Name>
CLI::Validator one_of(const List& list, const Name& name) {
  std::vector<std::string> names;
  for (const auto& one : list) names.emplace_back(name(one));
  return CLI::IsMember(names);
}

}  // namespace bench
