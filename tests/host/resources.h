/* Resources of the FMU whose library is at path, PLACE/binaries/PLATFORM/NAME. Needs stdio.h and string.h. */
static const char *resources_of(const char *path) {
    static char place[2048];
    size_t n = strlen(path);
    for (int levels = 0; n && levels < 3; n--) levels += path[n - 1] == '/' || path[n - 1] == '\\';
    snprintf(place, sizeof place, "%.*s/resources/", (int)n, path);
    return place;
}
