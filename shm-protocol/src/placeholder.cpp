// Replaced by the segment and the endpoints.
