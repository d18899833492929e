// Parsers of flag values that several commands share. Every function throws scene::InputError, one line that
// names the flag and what would be right.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "smartsurf/run/cli/RunOptions.h"

namespace smartsurf::run {

double parse_positive_number(const std::string& flag, const std::string& text);
// FILE.png or FILE.png@SECONDS
Screenshot parse_screenshot(const std::string& text);
// NAME=VALUE
std::vector<std::pair<std::string, std::string>> parse_assignments(
    const std::vector<std::string>& assignments);
void reject_both(bool both_given, const char* flags);

}  // namespace smartsurf::run
