// Parsers of flag values shared by several subcommands. Every function throws scene::InputError, one line
// that names the flag and the expected form.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/scene/NamedValues.h"

namespace smartsurf::run {

// A number in (0, 1e9].
double parse_positive_number(const std::string& flag, const std::string& text);
// FILE.png or FILE.png@SECONDS.
Screenshot parse_screenshot(const std::string& text);
// Splits each NAME=VALUE of --set, and each NAME=RANGE of --vary into vary.NAME and RANGE.
scene::Overrides parse_overrides(const std::vector<std::string>& set, const std::vector<std::string>& vary);
// Throws if two mutually exclusive flags are given. flags: "--a and --b".
void reject_both(bool both_given, const char* flags);

}  // namespace smartsurf::run
