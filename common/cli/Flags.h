// The flags of a small program in the manner of getopt.
#pragma once

#include <getopt.h>

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace common {

struct Flag {
  const char* name;
  int argument;  // no_argument, required_argument or optional_argument
  std::function<void(const char* value)> read;
  char letter = 0;  // the short form, if there is one
};

// Calls `read` of each flag that is given; the operands begin at optind. Stops at one without a `read` and
// returns its name, and "?" at one that is not known or lacks its value; otherwise the name is empty. Throws
// std::invalid_argument for a value that is required and empty.
inline std::string_view read_flags(int argc, char** argv, const std::vector<Flag>& flags) {
  constexpr int kFirst = 256;  // beyond all letters
  std::vector<option> known;
  std::string letters;
  for (const Flag& f : flags) {
    known.push_back({f.name, f.argument, nullptr, kFirst + static_cast<int>(known.size())});
    if (f.letter != 0) letters += f.letter + std::string(f.argument, ':');
  }
  known.push_back({});
  for (int found; (found = ::getopt_long(argc, argv, letters.c_str(), known.data(), nullptr)) != -1;) {
    const auto flag = std::ranges::find_if(
        flags, [&](const Flag& f) { return f.letter == found || &f - flags.data() == found - kFirst; });
    if (flag == flags.end()) return "?";
    if (!flag->read) return flag->name;
    if (flag->argument == required_argument && *::optarg == '\0')
      throw std::invalid_argument(std::string("--") + flag->name + ": must not be empty");
    flag->read(::optarg);
  }
  return {};
}

}  // namespace common
