"""What every test gets: hypothesis without a stopwatch, since the machine may be busy with other things."""

from hypothesis import settings

settings.register_profile("apartment", deadline=None)
settings.load_profile("apartment")
