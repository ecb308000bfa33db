"""The REST API: one file for each part of it, which ``service.web.app`` puts together."""
