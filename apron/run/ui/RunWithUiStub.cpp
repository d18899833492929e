// Replaces the user interface in a build with -DSMARTSURF_VIEW=OFF.
#include "apron/run/ui/RunWithUi.h"

namespace apron::run {

std::string ui_unavailable_reason(const Options& options) {
  return std::string(options.window ? "--window" : "--screenshot, --video") +
         ": this apron was built without windows and pictures: configure with -DSMARTSURF_VIEW=ON";
}

UiRunResult run_with_ui(const UiRun& run) {
  UiRunResult result;
  result.ui_error = ui_unavailable_reason(run.options);
  return result;
}

}  // namespace apron::run
