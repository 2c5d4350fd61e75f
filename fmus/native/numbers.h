/* Numbers of an FMU: the file numbers.bin of its resources, written by numbers_file.py, which has its layout. Included
   by instance.h, after the type Instance. */
#if defined _WIN32
static FILE *open_file(const char *path) {
    wchar_t wide[LONGEST];
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, LONGEST) ? _wfopen(wide, L"rb") : 0;
}
#else
static FILE *open_file(const char *path) { return fopen(path, "rb"); }
#endif

static uint32_t crc32(const unsigned char *b, size_t n) {
    uint32_t table[256], sum = 0xffffffffu;
    for (uint32_t i = 0; i < 256; i++) {
        table[i] = i;
        for (int k = 0; k < 8; k++) table[i] = table[i] >> 1 ^ (table[i] & 1 ? 0xedb88320u : 0);
    }
    while (n--) sum = sum >> 8 ^ table[(sum ^ *b++) & 255];
    return ~sum;
}

static int digit(char c) { /* hexadecimal; -1: it is none */
    if (c >= '0' && c <= '9') return c - '0';
    return (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
}

/* Path of the file of numbers, from the URI of FMI 2.0 or the path of FMI 3.0; 0: it is too long. Some hosts give a URI
   with characters that they should have encoded: then it is not to be decoded. */
static int numbers_path(const char *resources, int encoded, char *path) {
    size_t n = 0;
    const char *from = resources;
    int is_uri = !strncmp(from, "file:", 5);
    if (is_uri) {
        from += 5;
        if (!strncmp(from, "//", 2)) {
            from += 2;
            if (!strncmp(from, "localhost/", 10)) from += 9;
        }
#if defined _WIN32
        if (from[0] == '/' && from[1] && from[2] == ':') from++; /* /C:/... */
#endif
    }
    for (; *from && n < LONGEST - sizeof NUMBERS_FILE - 1; from++) {
        int escaped = is_uri && encoded && *from == '%' && digit(from[1]) >= 0 && digit(from[2]) >= 0;
        path[n++] = escaped ? (char)(digit(from[1]) * 16 + digit(from[2])) : *from;
        if (escaped) from += 2;
    }
    if (*from) return 0;
    if (n && path[n - 1] != '/' && path[n - 1] != '\\') path[n++] = '/';
    strcpy(path + n, NUMBERS_FILE);
    return 1;
}

/* Point at the parts of the content, n bytes behind the head; 0: they do not fit. */
static int divide(Numbers *of, const char *at, size_t n) {
    size_t fixed = 8 * ((size_t)N_REAL + N_STRING + N_STATE + N_COUNTER + N_K + (N_Z + 7) / 8 + 1);
    const char *end = at + n;
    if (n < fixed) return 0;
    of->start = (const double *)at, at += 8 * (size_t)N_REAL;
    of->choice = (const int64_t *)at, at += 8 * (size_t)N_STRING;
    of->x = (const double *)at, at += 8 * (size_t)N_STATE;
    of->n = (const int64_t *)at, at += 8 * (size_t)N_COUNTER;
    of->k = (const int64_t *)at, at += 8 * (size_t)N_K;
    of->z = at, at += (N_Z + 7) / 8 * 8;
    of->pieces = *(const int64_t *)at, at += 8;
    of->f = at;
    for (int64_t i = 0; i < of->pieces; i++) {
        const int64_t *piece = (const int64_t *)at; /* its first float, its number of floats, these floats */
        if (end - at < 16 || piece[0] < 0 || piece[1] < 0 || piece[0] > N_F - piece[1]) return 0;
        if (piece[1] > (end - at - 16) / 8) return 0;
        at += 16 + 8 * piece[1];
    }
    for (int i = 0; i < N_STRING; i++) {
        if (of->choice[i] < 0 || (of->choice[i] && of->choice[i] >= CHOICE[i].count)) return 0;
        if (CHOICE[i].count) continue;
        of->text[i] = at;
        if (!(at = memchr(at, 0, (size_t)(end - at)))) return 0;
        at++;
    }
    return end - at < 8;
}

/* Read and check the numbers of a resource location; 0: refused with a sentence. */
static int read_numbers(Instance *c, const char *resources) {
    char path[LONGEST];
    NumbersHead head;
    if (!resources || !*resources) {
        refuse(c, "no resource location is given: the numbers of this FMU are in its resources, %s", NUMBERS_FILE);
        return 0;
    }
    if (!numbers_path(resources, 0, path) || !numbers_path(resources, 1, path)) {
        refuse(c, "the path of the resources is too long: the numbers of this FMU are there, %s", NUMBERS_FILE);
        return 0;
    }
    FILE *file = open_file(path);
    if (!file && numbers_path(resources, 0, path) && !(file = open_file(path))) numbers_path(resources, 1, path);
    if (!file || fread(&head, sizeof head, 1, file) != 1) {
        if (file) fclose(file);
        refuse(c, "the numbers of this FMU cannot be read: '%s'", path);
        return 0;
    }
    const char *flaw = 0;
    if (memcmp(head.magic, NUMBERS_MAGIC, sizeof head.magic) || head.version != NUMBERS_VERSION)
        flaw = "is no file of numbers of this version";
    else if (memcmp(head.shape, SHAPE, sizeof SHAPE))
        flaw = "holds the numbers of another kind of FMU";
    else if (head.length > N_LONGEST_NUMBERS || !(c->numbers.content = malloc(head.length + 8)))
        flaw = "is damaged";
    else if (fread(c->numbers.content, 1, head.length, file) != head.length ||
             crc32(c->numbers.content, head.length) != head.sum ||
             !divide(&c->numbers, (char *)c->numbers.content, head.length))
        flaw = "is damaged";
    fclose(file);
    if (flaw) refuse(c, "'%s' %s", path, flaw);
    c->numbers.sum = (uint32_t)head.sum;
    return !flaw;
}
