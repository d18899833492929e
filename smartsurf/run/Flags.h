// The values of flags that more than one command takes. Every function throws scene::InputError, one line
// that names the flag and what would be right.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "smartsurf/run/RunOptions.h"

namespace smartsurf::run {

double positive_number(const std::string& flag, const std::string& text);
// FILE.png or FILE.png@SECONDS
Screenshot screenshot_of(const std::string& text);
// NAME=VALUE
std::vector<std::pair<std::string, std::string>> pairs_of(const std::vector<std::string>& settings);
void reject_both(bool both, const char* flags);

}  // namespace smartsurf::run
