// Stands in for windows and pictures in a build with -DSMARTSURF_VIEW=OFF.
#include "apron/run/DrawnRun.h"

namespace apron::run {

std::string drawing_unavailable(const Options& options) {
  return std::string(options.window ? "--window" : "--screenshot, --video") +
         ": this apron was built without windows and pictures: configure with -DSMARTSURF_VIEW=ON";
}

DrawnOutcome run_drawn(const DrawnRun& run) {
  DrawnOutcome outcome;
  outcome.wrong = drawing_unavailable(run.options);
  return outcome;
}

}  // namespace apron::run
