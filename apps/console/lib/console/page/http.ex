defmodule Console.Page.Http do
  @moduledoc """
  Reads what a request to a server of the page says, and answers it, by mochiweb. All that is served here is guarded alike
  (`Console.Page.Access`).
  """
  # Debian's package; without it there is no page.
  @compile {:no_warn_undefined, [:mochiweb_request]}
  alias Console.Page
  alias Console.Page.Door

  @typedoc "A request of mochiweb."
  @type request :: term()

  @headers [
    {"Server", "Convoy"},
    {"Cache-Control", "no-store"},
    {"X-Content-Type-Options", "nosniff"},
    {"Referrer-Policy", "no-referrer"},
    {"Content-Security-Policy", "default-src 'self'; frame-ancestors 'none'"}
  ]

  @doc """
  Whether a request may be answered; `page` has the door and what guards it (`t:Console.Page.Access.guard/0`), `origin?`
  says of which pages of others besides, and `methods` are those that are understood. The error is the status and one line.
  """
  @spec admitted(request(), map(), origin? :: (String.t() -> boolean()), methods :: [String.t()]) ::
          :ok | {status :: 400..499, line :: String.t()}
  def admitted(request, page, origin? \\ fn _origin -> false end, methods \\ ["GET"]) do
    asked = asked(request, page, origin?)
    method = request |> get(:method) |> to_string()

    if method in methods,
      do: asked |> Page.Access.check(page) |> guessed(asked, page),
      else: {405, "#{method} is not understood here; #{Enum.join(methods, " and ")} is"}
  end

  defp guessed(:guess, asked, page) do
    case Door.guess(page.door, asked.token) do
      :ok -> :ok
      :wrong -> {401, "this is not the page's token: open the page with ?token=…"}
      :late -> {429, "too many wrong tokens came from there: wait some seconds"}
    end
  end

  defp guessed(answer, _asked, _page), do: answer

  defp asked(request, page, origin?) do
    origin = header(request, "Origin")

    %{
      host: header(request, "Host"),
      origin: if(origin == nil or origin?.(origin), do: nil, else: origin),
      token: query(request, "token"),
      session: found(:mochiweb_request.parse_cookie(request), cookie_name(page))
    }
  end

  @doc "The address and port of the other end of a connection, for logs; `?` of one that is gone."
  @spec peer(:inet.socket()) :: String.t()
  def peer(socket) do
    case :inet.peername(socket) do
      {:ok, {address, port}} -> "#{:inet.ntoa(address)}:#{port}"
      {:error, _gone} -> "?"
    end
  end

  @doc "Answers with one line of text."
  @spec say(request(), 400..599, line :: String.t()) :: term()
  def say(request, status, line),
    do: respond(request, status, [{"Content-Type", "text/plain; charset=utf-8"}], line <> "\n")

  @doc "Answers with a body and these headers besides those of all answers."
  @spec respond(request(), 100..599, [{String.t(), iodata()}], iodata()) :: term()
  def respond(request, status, headers, body),
    do: :mochiweb_request.respond({status, headers ++ @headers, body}, request)

  @doc "What mochiweb knows of a request."
  @spec get(request(), atom()) :: term()
  def get(request, what), do: :mochiweb_request.get(what, request)

  @doc "A header, or `nil`."
  @spec header(request(), String.t()) :: String.t() | nil
  def header(request, name) do
    case :mochiweb_request.get_header_value(String.to_charlist(name), request) do
      :undefined -> nil
      value -> to_string(value)
    end
  end

  @doc "A value of the address's query, or `nil`."
  @spec query(request(), String.t()) :: String.t() | nil
  def query(request, name), do: found(:mochiweb_request.parse_qs(request), name)

  @doc "The cookie of those that have said the token. Ports of one host share their cookies."
  @spec cookie_name(map()) :: String.t()
  def cookie_name(page), do: "convoy_#{page.port}"

  defp found(pairs, name) do
    with {_name, value} <- List.keyfind(pairs, String.to_charlist(name), 0), do: to_string(value)
  end
end
