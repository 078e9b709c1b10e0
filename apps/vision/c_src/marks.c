/* AprilTags in the luma of a picture, by Debian's libapriltag. */
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>

#include "marks.h"

struct marks_detector {
    enum marks_family kind;
    apriltag_family_t *family;
    apriltag_detector_t *detector;
};

/* With two corrected bits a picture without marks shows some now and then. */
#define CORRECTED_BITS 1

static apriltag_family_t *family_new(enum marks_family kind)
{
    return kind == MARKS_36H11 ? tag36h11_create() : tagStandard41h12_create();
}

static void family_free(enum marks_family kind, apriltag_family_t *family)
{
    if (kind == MARKS_36H11)
        tag36h11_destroy(family);
    else
        tagStandard41h12_destroy(family);
}

struct marks_detector *marks_new(enum marks_family kind)
{
    struct marks_detector *made = calloc(1, sizeof *made);

    if (made == NULL)
        return NULL;
    made->kind = kind;
    made->family = family_new(kind);
    made->detector = apriltag_detector_create();
    apriltag_detector_add_family_bits(made->detector, made->family, CORRECTED_BITS);
    made->detector->nthreads = 1;
    made->detector->quad_decimate = 1.0f;
    return made;
}

void marks_free(struct marks_detector *detector)
{
    apriltag_detector_destroy(detector->detector);
    family_free(detector->kind, detector->family);
    free(detector);
}

/* The library's pixels have their centres at halves, and its corners begin at the lower left. */
static struct marks_found found(const apriltag_detection_t *seen)
{
    struct marks_found found = { .id = seen->id, .hamming = seen->hamming, .margin = seen->decision_margin,
                                 .x = seen->c[0] - 0.5, .y = seen->c[1] - 0.5 };

    for (int k = 0; k < 4; k++)
        for (int axis = 0; axis < 2; axis++)
            found.corners[k][axis] = seen->p[3 - k][axis] - 0.5;
    return found;
}

int marks_find(struct marks_detector *detector, const struct marks_luma *luma, marks_report *report, void *context)
{
    const size_t width = luma->width;
    uint8_t *bytes = malloc(width * luma->height);

    if (bytes == NULL)
        return -1;
    for (size_t row = 0; row < luma->height; row++)
        for (size_t column = 0; column < width; column++)
            bytes[row * width + column] = luma->first[row * luma->row + column * luma->step];

    /* The library's own functions for this are not in Debian's. */
    image_u8_t image = { (int32_t)width, (int32_t)luma->height, (int32_t)width, bytes };
    zarray_t *all = apriltag_detector_detect(detector->detector, &image);

    for (int k = 0; k < zarray_size(all); k++) {
        apriltag_detection_t *seen;

        zarray_get(all, k, &seen);
        struct marks_found one = found(seen);

        report(&one, context);
    }
    apriltag_detections_destroy(all);
    free(bytes);
    return 0;
}

int marks_cells(enum marks_family kind, uint32_t id, uint8_t picture[MARKS_CELLS * MARKS_CELLS], int *cells, int *border)
{
    apriltag_family_t *family = family_new(kind);
    int known = id < family->ncodes && family->total_width <= MARKS_CELLS;

    if (known) {
        image_u8_t *image = apriltag_to_image(family, id);

        *cells = family->total_width;
        *border = family->width_at_border;
        for (int row = 0; row < *cells; row++)
            for (int column = 0; column < *cells; column++)
                picture[row * *cells + column] = image->buf[row * image->stride + column] != 0;
        free(image->buf);
        free(image);
    }
    family_free(kind, family);
    return known ? 0 : -1;
}
